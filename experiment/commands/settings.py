"""What `--set NODE.NAME:=VALUE` says."""

from collections.abc import Sequence

import yaml

from msgs_config.errors import ConfigurationError, one_of


def node_settings(texts: Sequence[str], nodes: Sequence[str]) -> dict[str, dict[str, object]]:
    """The parameters that are set, by node; values are YAML.

    Raises:
        ConfigurationError: a text is not of that form, its node is none of these, or its value is
            no YAML.
    """
    node_name = nodes[0] if len(nodes) == 1 else "NODE"
    settings: dict[str, dict[str, object]] = {node: {} for node in nodes}
    for text in texts:
        name, assigns, value = text.partition(":=")
        node, dot, parameter = name.partition(".")
        if not (assigns and dot and parameter):
            raise ConfigurationError(f"--set {text}: write it as {node_name}.NAME:=VALUE")
        if node not in settings:
            raise ConfigurationError(f"--set {text}: {one_of('node', node, list(nodes))}")
        try:
            settings[node][parameter] = yaml.safe_load(value)
        except (yaml.YAMLError, ValueError, RecursionError) as error:
            raise ConfigurationError(f"--set {text}: the value is not valid YAML") from error
    return settings
