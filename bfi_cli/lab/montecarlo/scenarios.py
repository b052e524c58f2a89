"""From a sweep's YAML to its scenarios, and to trials whose random numbers depend on nothing but what they are."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from ... import __version__
from ...config import Config, merge
from ...dictionary import Dictionary, load_dictionary
from ...errors import ConfigError
from ...faults import Fault, did_you_mean
from ...faults.fault import is_same_fault
from ...faults.shapes import PARAMETERS, SHAPES
from ...faults.validation import validate
from ...printable import printable
from ...yaml12 import load_yaml, read_text
from ..compare import Peer
from .definition import FlownModel, InjectedFault, RecordedLog, SweepRules


def is_one_of(fault: Fault, entry: Fault) -> bool:
    """Say whether an entry of a dictionary is the right answer to a fault: that fault, or the kind of it.

    Onsets that are not stated agree where both could be the same; a kind without a frequency, time constant or duration
    has any.
    """
    ends = [either.onset_range_s or (either.onset_s, either.onset_s) for either in (fault, entry)]
    if max(low for low, _ in ends) > min(high for _, high in ends):
        return False
    if entry.onset_range_s is not None:
        stated = {key: getattr(fault, key) for key in PARAMETERS if getattr(entry, key) is None}
        entry = replace(entry, offset_s=fault.offset_s, **stated)
    return is_same_fault(
        replace(entry, onset_s=0.0, onset_range_s=None), replace(fault, onset_s=0.0, onset_range_s=None)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """What trials with different faults have in common; equal settings have equal digests.

    Attributes
    ----------
    record : what the faults are added to; dictionary : what they are drawn from and looked for in.
    noise : (channel, standard deviation) of the noise added.
    config : of the analysis.
    injected : the faults that every trial has.
    peer : the method of `bfi compare` that is run in place of `bfi identify`, with its name; None for none.
    """

    digest: str
    record: FlownModel | RecordedLog = field(compare=False)
    dictionary: Dictionary = field(compare=False)
    noise: tuple[tuple[str, float], ...] = field(compare=False)
    config: Config = field(compare=False)
    injected: tuple[InjectedFault, ...] = field(compare=False, default=())
    peer: tuple[str, Peer] | None = field(compare=False, default=None)

    @property
    def right(self) -> dict[str, tuple[str, ...]]:
        """Entries of the dictionary that are right answers to each injected fault, by what that is called."""
        return {
            injected.name or (right[0] if right else injected.shape): right
            for injected, right in ((fault, self._right_for(fault)) for fault in self.injected)
        }

    def _right_for(self, injected: InjectedFault) -> tuple[str, ...]:
        """Return the entries of the dictionary that are stated to be right answers, else those that are that fault."""
        if injected.right is not None:
            return injected.right
        fault = injected.fault()
        return tuple(atom.called for atom in self.dictionary.atoms if is_one_of(fault, atom))


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """One combination of the grid.

    Attributes
    ----------
    name : the axes that vary and their values.
    axes : value by axis, those that do not vary too.
    n_active : faults in each trial; sizes : what their magnitudes are drawn from.
    stream : first keys of its random streams.
    """

    name: str
    axes: Mapping[str, Any] = field(compare=False)
    setting: Setting
    n_active: int
    sizes: tuple[float, ...]
    stream: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One trial of a scenario; the seed is all that is random about it."""

    scenario: Scenario
    number: int
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sweep:
    """All scenarios.

    Attributes
    ----------
    path, sha256 : of the file it was read from.
    digest : of everything a row depends on but the records' contents; the number of trials is not part of it.
    workers, scheduler : where the file wants it to run.
    false_alarm : at which scores are compared, of a sweep of methods of `bfi compare`.
    """

    path: str
    sha256: str
    scenarios: tuple[Scenario, ...]
    n_trials: int
    seed: int
    workers: int
    scheduler: str | None
    false_alarm: float | None = None

    @property
    def digest(self) -> str:
        scenarios = [(s.name, s.setting.digest, s.n_active, s.sizes, s.stream) for s in self.scenarios]
        return digest_of_parts([__version__, self.seed, scenarios])

    def trials(self) -> Iterator[Trial]:
        """Yield the first trial of every scenario, then the second of each: a longer sweep begins with a shorter one.

        Scenarios that differ in record, noise or analysis only meet the same faults and the same random numbers.
        """
        for number in range(self.n_trials):
            for scenario in self.scenarios:
                child = np.random.SeedSequence(self.seed, spawn_key=(*scenario.stream, number))
                yield Trial(scenario=scenario, number=number, seed=int(child.generate_state(1, np.uint64)[0]))


def load_sweep(
    path: str | Path, *, trials: int | None = None, seed: int | None = None, allow_outside: bool = False
) -> Sweep:
    """Return the sweep of a YAML file.

    Parameters
    ----------
    trials, seed : in place of the file's.
    allow_outside : sample files may lie outside the folder of their dictionary.

    Raises
    ------
    ConfigError : everything that is wrong with it, in one line.
    DictionaryError : a dictionary cannot be used.
    """
    path = Path(path)
    data = load_yaml(read_text(path, error=ConfigError), where=str(path), error=ConfigError)
    context = {"folder": path.parent, "allow_outside": allow_outside}
    rules = validate(SweepRules, {} if data is None else data, where=str(path), error=ConfigError, context=context)
    return Sweep(
        path=str(path),
        sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
        scenarios=_scenarios(rules, str(path), allow_outside),
        n_trials=rules.trials if trials is None else trials,
        seed=rules.seed if seed is None else seed,
        workers=rules.workers,
        scheduler=rules.scheduler,
        false_alarm=None if rules.compare is None else rules.compare.false_alarm,
    )


def _scenarios(rules: SweepRules, where: str, allow_outside: bool) -> tuple[Scenario, ...]:
    """Return every combination of what varies, records first."""
    dictionaries: list[Dictionary] = []
    for source in rules.dictionary:
        name = None if isinstance(source, str) else f"{where}: dictionary"
        dictionaries.append(load_dictionary(source, where=name, allow_outside=allow_outside))
    configs = _configs(rules, where)
    for dictionary in dictionaries:
        _check_drawn(dictionary, max(rules.active), where)
    axes: dict[str, Sequence[tuple[str, Any]]] = {
        "record": _labelled([record.label for record in rules.record], rules.record),
        "dictionary": _labelled([Path(d.path).stem for d in dictionaries], list(enumerate(dictionaries))),
        **{f"noise.{name}": [(f"{sd:g}", sd) for sd in sizes] for name, sizes in rules.noise.items()},
        "active": [(str(n), n) for n in rules.active],
        "inject": _labelled([_label_of(faults) for faults in rules.injections], rules.injections),
        "identify": configs,
        "compare": [("", None)] if rules.compare is None else [(peer[0], peer) for peer in rules.compare.peers.items()],
    }
    varying = [name for name, values in axes.items() if len(values) > 1]
    scenarios: list[Scenario] = []
    for combination in product(*axes.values()):
        chosen = dict(zip(axes, combination, strict=True))
        value = {name: entry for name, (_, entry) in chosen.items()}
        place, dictionary = value["dictionary"]
        settings, config = value["identify"]
        noise = tuple((name, value[f"noise.{name}"]) for name in rules.noise)
        parts = [value["record"].model_dump(mode="json"), dictionary.sha256, noise, config.model_dump(mode="json")]
        parts += [injected.model_dump(mode="json") for injected in value["inject"]]
        if rules.compare is not None:
            parts.append(["compare", method := chosen["compare"][0], rules.compare.programs.get(method, "")])
        words = [f"{name}={chosen[name][0]}" if name != "identify" else chosen[name][0] for name in varying]
        name = printable(" ".join(words)) or "all"  # as trials.csv has it, where --resume looks for it
        if any(name == other.name for other in scenarios):
            raise ConfigError(f"{where}: a value stands twice, got two scenarios '{name}'; keep one")
        setting = Setting(
            digest=digest_of_parts(parts),
            record=value["record"],
            dictionary=dictionary,
            noise=noise,
            config=config,
            injected=value["inject"],
            peer=value["compare"],
        )
        _check_injected(setting, value["active"], f"{where}: inject[{rules.injections.index(setting.injected)}]")
        left_out = {"identify", *(["inject"] * (rules.injections == ((),))), *(["compare"] * (rules.compare is None))}
        labels = {name: label for name, (label, _) in chosen.items() if name not in left_out}
        scenarios.append(
            Scenario(
                name=name,
                axes={**labels, **{f"noise.{name}": sd for name, sd in noise}, "active": value["active"], **settings},
                setting=setting,
                n_active=value["active"],
                sizes=rules.sizes,
                stream=(place, value["active"]),
            )
        )
    return tuple(scenarios)


def _check_drawn(dictionary: Dictionary, n_active: int, where: str) -> None:
    """Refuse to draw more faults than a dictionary has, or of an entry that does not state what a fault needs."""
    if n_active > len(dictionary.atoms):
        raise ConfigError(
            f"{where}: active: more than the {len(dictionary.atoms)} faults of {dictionary.path}, got {n_active}; "
            "lower it"
        )
    for atom in dictionary.atoms if n_active else ():
        for key in SHAPES[atom.shape].keys:
            if key.required and getattr(atom, key.name) is None:
                raise ConfigError(
                    f"{where}: active: a fault that is drawn needs a {key.name}, and {dictionary.path} states none "
                    f"of '{atom.called}'; add it there, or make active 0"
                )


def _configs(rules: SweepRules, where: str) -> list[tuple[str, tuple[dict[str, Any], Config]]]:
    """Return (label, (value by key, configuration)) of every combination of the grid."""
    configs, complaints = [], []
    for values in product(*rules.grid.values()):
        settings = dict(zip(rules.grid, values, strict=True))
        try:
            config = merge(rules.identify, settings, where="grid")
        except ConfigError as error:
            complaints += str(error).removeprefix("grid: ").split(" | ")
        else:
            words = []
            for key in (key for key, several in rules.grid.items() if len(several) > 1):
                value = settings[key]
                words.append(f"{key}={value if isinstance(value, str) else json.dumps(value, default=str)}")
            configs.append((" ".join(words), (settings, config)))
    if complaints:
        raise ConfigError(f"{where}: " + " | ".join(f"grid.{text}" for text in dict.fromkeys(complaints)))
    return configs


def size_of(fault: Fault) -> float:
    """Return the magnitude of a fault, 1 of one that is whole."""
    return fault.magnitude if SHAPES[fault.shape].has_magnitude else 1.0


def _check_injected(setting: Setting, n_active: int, where: str) -> None:
    """Refuse injected faults whose right answers, or whose names, the dictionary does not leave clear."""
    path, names = setting.dictionary.path, [atom.called for atom in setting.dictionary.atoms]
    if len(setting.right) < len(setting.injected):
        called = ", ".join(f"'{name}'" for name in setting.right)
        raise ConfigError(f"{where}: name: two faults are called the same, got {called}; give each a name")
    for injected, (called, right) in zip(setting.injected, setting.right.items(), strict=True):
        for name in right:
            if name not in names:
                raise ConfigError(f"{where}.right: no entry of {path}, got '{name}'{did_you_mean(name, names)}")
        if called in names and called not in right:
            raise ConfigError(
                f"{where}.name: is another entry of {path}, got '{called}'; choose another, or name that entry in right"
            )
        if size_of(injected.fault()) == 0.0:
            raise ConfigError(f"{where}.magnitude: 0 is no fault; write null in its place for none")
    left = len(set(names) - {name for right in setting.right.values() for name in right})
    if n_active > left:
        file, _, _ = where.rpartition(": ")
        raise ConfigError(
            f"{file}: active: more than the {left} faults of {path} beside the injected ones, got {n_active}; lower it"
        )


def _label_of(faults: Sequence[InjectedFault]) -> str:
    sizes = ["" if fault.magnitude is None else f"_{fault.magnitude:g}" for fault in faults]
    return "+".join(fault.name or f"{fault.shape}{size}" for fault, size in zip(faults, sizes, strict=True)) or "none"


def _labelled(labels: Sequence[str], values: Sequence[Any]) -> list[tuple[str, Any]]:
    """Pair values with labels, numbered where two are alike."""
    alike = len(set(labels)) < len(labels)
    pairs = enumerate(zip(labels, values, strict=True), 1)
    return [(f"{label}-{n}" if alike else label, value) for n, (label, value) in pairs]


def digest_of_parts(parts: object) -> str:
    """Return what tells plain data from any other."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()
