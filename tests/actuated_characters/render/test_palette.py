"""Which characters have the colours of one team."""

from actuated_characters.render.skin.palette import team_numbers


def test_names_that_differ_in_a_number_are_a_team() -> None:
    assert team_numbers(["sand_1", "sand_2", "blue_1", "left", "blue_12"]) == [0, 0, 1, 2, 1]
    assert team_numbers([]) == []
