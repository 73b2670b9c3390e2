"""The order of a character's links: depth first, as MuJoCo has them."""

from dataclasses import replace

from msgs_config.character.model import Link


def sort_depth_first(links: list[Link]) -> list[Link]:
    """The links with every child right after its parent's branch so far, parents renumbered."""
    children: list[list[int]] = [[] for _ in links]
    for index, link in enumerate(links[1:], start=1):
        children[link.parent].append(index)
    order: list[int] = []
    pending = [0]
    while pending:
        order.append(pending.pop())
        pending += reversed(children[order[-1]])
    place = {old: new for new, old in enumerate(order)} | {-1: -1}
    return [replace(links[old], parent=place[links[old].parent]) for old in order]
