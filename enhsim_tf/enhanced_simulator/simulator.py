"""The product, steps 5 and "Combined" of the paper's pipeline: coarse simulator -> enhanced -> + noise.

It puts the rooms below together and trains none of their networks by hand.
"""

import dataclasses
import itertools
import operator
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from enhsim_tf.coarse_simulator.degraded import Degraded
from enhsim_tf.coarse_simulator.square_waves import SquareWaveSimulator, units_of
from enhsim_tf.common.console import SILENT, Progress
from enhsim_tf.common.errors import InputError
from enhsim_tf.enhanced_simulator.saving import read_saved, write_saved
from enhsim_tf.enhancer import network as enhancer_network
from enhsim_tf.enhancer.training_pairs import Pairs, at_level, cut_pairs, cut_parts, even_places, random_places, set_by_shape, split_off
from enhsim_tf.keras_tools.backend import keras
from enhsim_tf.keras_tools.training import EpochsDone, fit_windows
from enhsim_tf.noise.convolutional_gan import convolutional_noise_gan
from enhsim_tf.noise.discriminator import build_discriminator
from enhsim_tf.noise.extraction import extract_noise, noise_unit
from enhsim_tf.noise.gan import NoiseGAN, num_overlapping
from enhsim_tf.noise.generator import build_generator
from enhsim_tf.telemetry.parquet_store import write_windows
from enhsim_tf.telemetry.series import Telemetry, check_telemetry, check_values
from enhsim_tf.telemetry.windows import cut_windows

_NUM_PHASES, _ROUNDS = 400, 3  # of a period, at which shapes are compared; trainings between which the clock is set anew
_NUM_LEVELS = 500  # times at which level and amplitude are remembered, at most
_CHUNK = 4_096  # windows generated at a time
_START_RANGE = 1_000_000  # samples; windows begin at a random one of these, so at every phase of the waves

# what `EnhancedSimulator.fit` is to be given to do what the paper does
PAPER: Mapping[str, Any] = MappingProxyType(
    {"num_windows": 1_500, "epochs": 40, "noise": "paper", "extraction": "moving average", "decay": False}
)


class EnhancedSimulator:
    """A coarse simulator whose output is enhanced to realistic telemetry.

    Args:
        coarse: The coarse simulator.
        enhancer: Network one, from coarse to enhanced windows of shape `(windows, samples)`.
        noise: Network two, trained.
        interval_s: Sampling interval in seconds.
        offset: What the enhancer's zero stands for, in the telemetry's unit.
        scale: What the enhancer's one stands for, in the telemetry's unit.
        levels: For telemetry whose level and amplitude change: shift and gain against the coarse simulator, in the order
            of time, shape `(times, 2)`. Each generated window has those of one of these times. None: they never change.
        trained: How the networks were trained, in plain JSON types: kept with them for the record.

    Example:
    >>> simulator = EnhancedSimulator.fit(telemetry, coarse=SquareWaveSimulator.fit(telemetry), seed=0)
    >>> windows = simulator.generate(num_windows=1000, scenario=Degraded("stuck", severity=0.5), seed=1)
    >>> simulator.save("model_dir")
    >>> simulator = EnhancedSimulator.load("model_dir")
    """

    def __init__(
        self,
        coarse: SquareWaveSimulator,
        enhancer: keras.Model,
        noise: NoiseGAN,
        interval_s: float = 1.0,
        offset: float = 0.0,
        scale: float = 1.0,
        levels: np.ndarray | None = None,
        trained: Mapping[str, Any] | None = None,
    ):
        self.levels = None if levels is None else np.asarray(levels, np.float64).reshape(-1, 2)
        self.trained = dict(trained or {})
        self.coarse, self.enhancer, self.noise = coarse, enhancer, noise
        self.interval_s, self.offset, self.scale = float(interval_s), float(offset), float(scale)

    @property
    def window(self) -> int:
        """Samples of a window."""
        return self.enhancer.input_shape[1]

    @classmethod
    def fit(
        cls,
        telemetry: Telemetry | Sequence[Telemetry],
        coarse: SquareWaveSimulator | None = None,
        seed: int = 0,
        num_windows: int = 15_000,
        epochs: int = 2,
        num_iterations: int = 1_000,
        moving_average: int = 25,
        normalise: bool = True,
        window: int = 500,
        noise: str = "convolutional",
        extraction: str = "enhancer",
        held_out: float = 0.0,
        decay: bool = True,
        follow: bool = False,
        verbose: int | str = "auto",
        progress: Progress = SILENT,
    ) -> "EnhancedSimulator":
        """Trains both networks on nominal telemetry.

        The defaults are not the paper's. Its generator repeats one pattern, and its moving average takes slow noise away
        with the signal: detectors trained on the result take real telemetry for anomalous. Trained on what these defaults
        make, with as many iterations, they hardly do so more often than detectors trained on real telemetry: docs/REPORT.md
        has the experiment. What the paper does is `fit(telemetry, **PAPER)`.

        Args:
            telemetry: Nominal telemetry, at least eight windows long, or two with the moving average; where it has gaps, its
                stretches on one clock.
            coarse: The coarse simulator, configured like the telemetry; None fits square waves to its longest stretch.
            seed: Seed of everything drawn.
            num_windows: Training windows, cut at random offsets.
            epochs: Passes of the enhancer over the windows.
            num_iterations: Adversarial iterations of the noise networks.
            moving_average: Width of the moving average that separates noise, in samples.
            normalise: Whether the networks see the telemetry in units of the coarse simulator's levels, and its noise at
                the scale of the paper's; False leaves values as they are, as the paper does.
            window: Samples of a window.
            noise: The networks that learn the noise: `paper`, or `convolutional`, which fill the space.
            extraction: What the noise is: what the `moving average` leaves of the telemetry, as in the paper, or what the
                `enhancer` leaves of it. A moving average takes slow noise away with the signal.
            held_out: With extraction by the enhancer: share of the telemetry, its end, that the enhancer does not learn
                from and that the noise comes from. 0 takes both from all of it, which is right where many windows, in few
                epochs, and coarse windows that repeat leave the enhancer no way to remember the noise of any.
            decay: Whether the enhancer's learning rate falls to zero along a cosine, instead of staying as in the paper:
                at a constant rate, the noise of the last batches stays in the weights.
            follow: Whether the coarse simulator is set to the clock, level and amplitude of each window before the enhancer
                learns it, for telemetry that drifts away from a fixed simulator. The epochs are done in three rounds; from
                the second on, clock and levels are set by the enhanced shape. The levels are kept and drawn from again.
            verbose: Progress bars: 0 none, 1 always, "auto" on a terminal.
            progress: Tells in lines how far both trainings are.

        Returns:
            The trained simulator.

        Raises:
            InputError: If the telemetry is none, not finite, constant or shorter than two windows, or if a count is too small.
        """
        parts = _parts_of(telemetry)
        _check_counts(window=(window, 2), num_windows=(num_windows, 1), epochs=(epochs, 1), num_iterations=(num_iterations, 0))
        if noise not in ("paper", "convolutional") or extraction not in ("moving average", "enhancer") or not 0 <= held_out < 1:
            raise InputError(
                "Expected noise to be paper or convolutional, extraction to be moving average or enhancer, 0 <= held_out < 1. "
                f"Received: noise={noise!r}, extraction={extraction!r}, held_out={held_out}."
            )
        by_enhancer, values = extraction == "enhancer", np.concatenate([part.values for part in parts])
        check_values(values, parts[0].name, (8 if by_enhancer else 2) * window)
        averaged = [] if by_enhancer else _extracted(parts, moving_average, window)
        coarse = SquareWaveSimulator.fit(max(parts, key=len)) if coarse is None else coarse
        offset, scale = units_of(coarse) if normalise else (0.0, 1.0)
        rng = np.random.default_rng(seed)
        bars = int(sys.stdout.isatty()) if verbose == "auto" else verbose  # Keras' own "auto" writes its bars into files too

        learnt, rest = split_off(parts, held_out if by_enhancer else 0.0)
        pairs = cut_pairs(learnt, coarse, random_places(learnt, window, num_windows, rng), window, follow)
        network = enhancer_network.build_enhancer(window, seed=seed)
        simulator = cls(coarse, network, None, parts[0].interval_s, offset, scale, levels=[[0.0, 1.0]] if follow else None)
        rounds, told = min(_ROUNDS, epochs) if follow else 1, progress.loop("enhancer, epoch", epochs)
        ends = np.linspace(0, epochs, rounds + 1).astype(int).tolist()
        for number, (begin, end) in enumerate(itertools.pairwise(ends)):
            epochs_now, callbacks = end - begin, [EpochsDone(told.within(begin))]
            pairs = simulator._set_by_shape(pairs) if number else pairs
            pairs = pairs.clear() if follow else pairs
            rate = keras.optimizers.schedules.CosineDecay(0.001, epochs_now * -(-len(pairs) // 15)) if decay else 0.001
            source, target = ((windows - offset) / scale for windows in (pairs.coarse, pairs.target_in_unit))
            fit_windows(network, source, target, epochs_now, 15, seed + number, rate, callbacks=callbacks, verbose=bars)
        if follow:
            seen = simulator.pairs(parts, even_places(parts, window, _NUM_LEVELS)).clear()
            simulator.levels = np.stack([seen.shift, seen.gain], axis=1)
        simulator.trained = {
            "telemetry": parts[0].name,
            "num_samples": len(values),
            "seed": seed,
            "num_windows": num_windows,
            "epochs": epochs,
            "num_iterations": num_iterations,
            "moving_average": moving_average,
            "noise": noise,
            "extraction": extraction,
            "held_out": held_out,
            "decay": decay,
            "follow": follow,
        }
        draw = np.random.default_rng([seed, 1])
        if by_enhancer:
            noise_windows = simulator.residual_windows(rest, num_windows, draw)
        else:
            noise_windows, _ = cut_parts(averaged, random_places(averaged, window, num_windows, draw), window)
        if noise == "convolutional":
            simulator.noise = convolutional_noise_gan(noise_windows, num_iterations, seed)
        else:
            noise_scale = noise_unit(noise_windows) if normalise else 1.0
            pair = build_generator(window, seed=seed), build_discriminator(window, seed=seed)
            simulator.noise = NoiseGAN(*pair, scale=noise_scale, seed=seed)
        told = progress.loop("noise GAN, iteration", num_iterations)
        simulator.noise.fit(noise_windows, num_iterations, verbose=None if verbose == "auto" else bool(verbose), on_iteration=told)
        return simulator

    def residual_windows(self, telemetry: Telemetry | Sequence[Telemetry], num_windows: int, rng: np.random.Generator) -> np.ndarray:
        """What the enhanced signal leaves of telemetry: its noise, and what the simulator does not know.

        Args:
            telemetry: Telemetry that the coarse simulator is in step with, or its stretches; a simulator that remembers
                levels is set to each window first.
            num_windows: Number of windows, cut at random offsets.
            rng: Owner of the offsets.

        Returns:
            float32 array of shape `(num_windows, samples)`, in the telemetry's unit.
        """
        parts = _parts_of(telemetry)
        _check_counts(num_windows=(num_windows, 0))
        pairs = self.pairs(parts, random_places(parts, self.window, num_windows, rng))
        return pairs.target - self.follow(pairs)

    def pairs(self, telemetry: Telemetry | Sequence[Telemetry], places: np.ndarray) -> Pairs:
        """Windows of telemetry with the coarse ones of the same times, set to their clock and levels if levels are remembered.

        Args:
            telemetry: Telemetry, or its stretches.
            places: Where each window begins, counted over the stretches as `pairs.num_places` counts.
        """
        pairs = cut_pairs(_parts_of(telemetry), self.coarse, places, self.window, self.levels is not None)
        return pairs if self.levels is None else self._set_by_shape(pairs)

    def _set_by_shape(self, pairs: Pairs) -> Pairs:
        """Pairs set by the enhanced shape; sums of several waves do not repeat, so they stay as their edges set them."""
        if len(self.coarse.waves) > 1:
            return pairs
        phases = self.coarse.waves[0].period_s * np.arange(_NUM_PHASES) / _NUM_PHASES
        coarse = self.coarse.simulate(phases[:, None] + self.interval_s * np.arange(self.window))
        return set_by_shape(pairs, coarse, self.enhance(coarse))

    def follow(self, pairs: Pairs) -> np.ndarray:
        """The enhanced, still clean counterpart of telemetry, at the level of each window, float32 of shape `(windows, samples)`.

        Args:
            pairs: Windows of the coarse simulator and how it was set to the telemetry's.
        """
        enhanced = self.enhance(pairs.coarse)
        return enhanced if self.levels is None else at_level(enhanced, pairs.shift, pairs.gain)

    def generate_coarse(self, num_windows: int, scenario: Degraded | None = None, seed: int = 0) -> np.ndarray:
        """Generates coarse windows (step 2) that begin at random samples, float32 of shape `(num_windows, samples)`.

        Args:
            num_windows: Number of windows.
            scenario: A degraded mode, or None for nominal telemetry.
            seed: Seed of everything drawn; the same seed gives the same.
        """
        _check_counts(num_windows=(num_windows, 0))
        rng = np.random.default_rng(seed)
        begins, levels = rng.integers(0, _START_RANGE, num_windows), self._draw_levels(num_windows, seed)
        coarse = self.coarse.simulate(self.interval_s * (begins[:, None] + np.arange(self.window)), scenario, rng)
        return coarse if levels is None else at_level(coarse, *levels.T)

    def _draw_levels(self, num_windows: int, seed: int) -> np.ndarray | None:
        """Shift and gain of each generated window, shape `(num_windows, 2)`: those of a time seen in training."""
        if self.levels is None:
            return None
        return self.levels[np.random.default_rng([seed, 2]).integers(0, len(self.levels), num_windows)]

    def enhance(self, coarse: np.ndarray) -> np.ndarray:
        """Enhanced, still clean windows (step 5) from coarse ones, float32 of the same shape `(windows, samples)`.

        Args:
            coarse: Coarse windows, as `generate_coarse` makes them.

        Raises:
            InputError: If they are not windows of the enhancer's width.
        """
        if np.ndim(coarse) != 2 or np.shape(coarse)[1] != self.window:
            raise InputError(f"Expected coarse windows of shape (windows, {self.window}). Received: shape {np.shape(coarse)}.")
        enhanced = enhancer_network.enhance(self.enhancer, (np.asarray(coarse) - self.offset) / self.scale)
        enhanced *= np.float32(self.scale)
        enhanced += np.float32(self.offset)
        return enhanced

    def generate(self, num_windows: int, scenario: Degraded | None = None, seed: int = 0) -> np.ndarray:
        """Generates realistic telemetry windows: enhanced signal plus generated noise ("Combined").

        Args:
            num_windows: Number of windows.
            scenario: A degraded mode, or None for nominal telemetry.
            seed: Seed of the windows' first samples, of the scenario and of the noise; the same seed gives the same.

        Returns:
            float32 array of shape `(num_windows, samples)`, in the telemetry's unit.

        Raises:
            InputError: If `num_windows` is negative or no whole number.
        """
        _check_counts(num_windows=(num_windows, 0))
        windows, filled = np.empty((num_windows, self.window), np.float32), 0
        for chunk in self.generate_chunks(num_windows, scenario, seed):
            windows[filled : filled + len(chunk)] = chunk
            filled += len(chunk)
        return windows

    def generate_chunks(self, num_windows: int, scenario: Degraded | None = None, seed: int = 0) -> Iterator[np.ndarray]:
        """Yields the windows of `generate` in turn, some thousand at a time: any number of them in the same memory.

        Args:
            num_windows: Number of windows.
            scenario: A degraded mode, or None for nominal telemetry.
            seed: Seed of everything drawn; the same seed gives the same.
        """
        noise_rng = _noise_rng(seed)
        for windows in self._clean_chunks(num_windows, scenario, seed):
            windows += self.noise.generate(len(windows), noise_rng)
            yield windows

    def generate_clean(self, num_windows: int, scenario: Degraded | None = None, seed: int = 0) -> np.ndarray:
        """The windows of `generate` before noise is added, of the same shape.

        Args:
            num_windows: Number of windows.
            scenario: A degraded mode, or None for nominal telemetry.
            seed: The seed of `generate`.
        """
        chunks = list(self._clean_chunks(num_windows, scenario, seed))
        return np.concatenate(chunks) if chunks else np.empty((0, self.window), np.float32)

    def _clean_chunks(self, num_windows: int, scenario: Degraded | None, seed: int) -> Iterator[np.ndarray]:
        _check_counts(num_windows=(num_windows, 0))
        rng = np.random.default_rng(seed)
        begins, levels = rng.integers(0, _START_RANGE, num_windows), self._draw_levels(num_windows, seed)
        for first in range(0, num_windows, _CHUNK):
            times = self.interval_s * (begins[first : first + _CHUNK, None] + np.arange(self.window))
            windows = self.enhance(self.coarse.simulate(times, scenario, rng))
            yield windows if levels is None else at_level(windows, *levels[first : first + _CHUNK].T)

    def generate_to_parquet(self, path: str | os.PathLike, num_windows: int, scenario: Degraded | None = None, seed: int = 0) -> None:
        """Writes the windows of `generate` to a Parquet file as they are made; the memory needed does not grow with their number.

        Args:
            path: The file.
            num_windows: Number of windows.
            scenario: A degraded mode, or None for nominal telemetry.
            seed: Seed of everything drawn; the same seed gives the same.
        """
        write_windows(path, self.generate_chunks(num_windows, scenario, seed), self.window)

    def generate_series(self, num_samples: int, scenario: Degraded | None = None, seed: int = 0, start_s: float = 0.0) -> np.ndarray:
        """Generates one continuous series of any length, without seams.

        Enhanced windows that overlap by half are faded into each other with weights that add up to one; the noise has a
        way of its own (`NoiseGAN.generate_series`). That of the paper's networks repeats a pattern every half window (it
        correlates at about 0.5 with itself there); with `noise="convolutional"` it does not.

        Args:
            num_samples: Length of the series.
            scenario: A degraded mode over the whole series, or None.
            seed: Seed of the scenario and of the noise.
            start_s: Time of the first sample on the coarse simulator's clock, in seconds.

        Returns:
            float32 array of shape `(num_samples,)`, in the telemetry's unit.
        """
        _check_counts(num_samples=(num_samples, 1))
        window, hop = self.window, self.window // 2
        num_windows = num_overlapping(num_samples, window)
        length = window + (num_windows - 1) * hop
        rng = np.random.default_rng(seed)
        times = start_s + self.interval_s * np.arange(length)[None]
        coarse = self.coarse.simulate(times, rng=rng)[0]
        if scenario is not None:  # the last window may reach beyond the end, which the scenario knows nothing of
            coarse[:num_samples] = self.coarse.simulate(times[:, :num_samples], scenario, rng)[0]
        begins = hop * np.arange(num_windows)
        enhanced = self.enhance(cut_windows(coarse, begins, window))
        if self.levels is not None:
            enhanced = at_level(enhanced, *self._follow_levels(num_windows, seed).T)

        fade = np.sin(np.pi * (np.arange(window) + 0.5) / window) ** 2  # of two windows half a window apart they add up to 1
        signal, total = np.zeros((2, length))
        for begin, clean in zip(begins, enhanced, strict=True):
            signal[begin : begin + window] += fade * clean
            total[begin : begin + window] += fade
        return (signal / total)[:num_samples].astype(np.float32) + self.noise.generate_series(num_samples, _noise_rng(seed))

    def _follow_levels(self, num_windows: int, seed: int) -> np.ndarray:
        """Shift and gain of windows that follow each other: the levels seen in training, forth and back from a random time."""
        there_and_back = np.concatenate([self.levels, self.levels[-2:0:-1]])
        begin = np.random.default_rng([seed, 2]).integers(0, len(there_and_back))
        return there_and_back[(begin + np.arange(num_windows)) % len(there_and_back)]

    def save(self, folder: str | os.PathLike) -> None:
        """Saves to a folder: three `.keras` files, `settings.json`, and `manifest.json` with their checksums.

        Raises:
            InputError: If something else than a saved simulator stands there, which is left as it is.
        """
        settings = {
            "coarse": self.coarse.get_config(),
            "noise": self.noise.get_config(),
            "interval_s": self.interval_s,
            "offset": self.offset,
            "scale": self.scale,
            "levels": None if self.levels is None else self.levels.tolist(),
            "trained": self.trained,
            "keras": keras.__version__,
        }
        networks = {"enhancer": self.enhancer, "generator": self.noise.generator, "discriminator": self.noise.discriminator}
        write_saved(folder, networks, settings)

    @classmethod
    def load(cls, folder: str | os.PathLike) -> "EnhancedSimulator":
        """Loads what `save` wrote, in Keras' safe mode.

        Raises:
            InputError: If the folder is not one that `save` wrote, or if a file in it was changed.
        """
        return read_saved(folder, cls._from_saved)

    @classmethod
    def _from_saved(cls, networks: Mapping[str, keras.Model], settings: Mapping[str, Any]) -> "EnhancedSimulator":
        coarse = SquareWaveSimulator.from_config(settings["coarse"])
        noise = NoiseGAN(networks["generator"], networks["discriminator"], **settings["noise"])
        units = settings["interval_s"], settings["offset"], settings["scale"], settings.get("levels")
        return cls(coarse, networks["enhancer"], noise, *units, settings["trained"])


def _parts_of(telemetry: Telemetry | Sequence[Telemetry]) -> list[Telemetry]:
    """The stretches of a series, each checked; a whole series is one."""
    parts = [telemetry] if isinstance(telemetry, Telemetry) or not isinstance(telemetry, Sequence) else list(telemetry)
    for part in parts:
        check_telemetry(part)
    if len({part.interval_s for part in parts}) != 1:
        raise InputError(f"Expected stretches of one sampling interval. Received: {sorted({part.interval_s for part in parts})}.")
    return parts


def _extracted(parts: Sequence[Telemetry], width: int, window: int) -> list[Telemetry]:
    """The noise that a moving average leaves of each stretch that is long enough for a window of it."""
    long_enough = [part for part in parts if len(part) >= window + width - 1]
    if not long_enough:
        raise InputError(
            f"Expected a stretch of {window + width - 1} samples: a window of {window} and what a moving average of width {width} cuts off. "
            f"Received: {max(map(len, parts))}. Give a longer one."
        )
    return [dataclasses.replace(part, values=extract_noise(part.values, width)[0]) for part in long_enough]


def _check_counts(**counts: tuple[Any, int]) -> None:
    """Refuses a count that is no whole number or below its least; each is given with it."""
    for name, (count, least) in counts.items():
        try:
            is_enough = operator.index(count) >= least
        except TypeError:
            is_enough = False
        if not is_enough:
            raise InputError(f"Expected {name} to be a whole number, at least {least}. Received: {name}={count!r}.")


def _noise_rng(seed: int) -> np.random.Generator:
    """Draws for the noise that have nothing to do with those for the coarse windows, which `seed` itself makes."""
    return np.random.default_rng([seed, 1])
