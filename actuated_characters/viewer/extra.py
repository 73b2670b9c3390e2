"""What the viewer needs that not every user has."""

from msgs_config.errors import ConfigurationError


def check_viser() -> None:
    """Raise ConfigurationError, with how to get it, if viser is not installed."""
    try:
        import viser
    except ImportError as error:
        raise ConfigurationError(
            "the viewer needs the extra 'view': pip install 'actuated_characters[view]', or in a "
            "clone .venv/bin/pip install -e '.[view]'"
        ) from error
    del viser
