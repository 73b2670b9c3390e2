"""What not every user needs, and so not every installation has: the extras of setup.py."""


def installation_of(extra: str) -> str:
    """The command that installs an extra, for the error that says that it is missing."""
    return (
        f"pip install 'actuated_characters[{extra}]', or in a clone "
        f".venv/bin/pip install -e '.[{extra}]'"
    )
