"""The published numbers of conf/paper.yaml."""

import pytest

from posture.config.errors import ConfigError
from posture.config.published import Table4, read_published, without_published
from posture.config.reading import read


def test_they_are_removed_from_a_composed_configuration_unless_changed():
    published = read_published().model_dump(mode="json")
    assert without_published({"seed": 1, "paper": published}) == {"seed": 1}
    assert without_published({"seed": 1}) == {"seed": 1}
    published["experiment_4a"]["window_steps"] += 1
    with pytest.raises(ConfigError, match="paper: published numbers cannot be changed on the command line"):
        without_published({"seed": 1, "paper": published})


def test_columns_of_a_table_are_equally_long():
    table = read_published().table_4.model_dump()
    with pytest.raises(ConfigError, match="columns must be equally long and not empty: .*mode has 1"):
        read(Table4, table | {"mode": ["in"]})
