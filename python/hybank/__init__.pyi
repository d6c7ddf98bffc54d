from collections.abc import Callable, Iterable, Iterator, KeysView, Mapping, Sequence
from os import PathLike
from types import SimpleNamespace, TracebackType
from typing import Any, Literal, TypeAlias, final, overload

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

__all__ = [
    "Alignment",
    "Analysis",
    "Bank",
    "Calibration",
    "Capture",
    "Captures",
    "Channel",
    "Comparison",
    "Figures",
    "FuseReport",
    "Gamma",
    "HybankError",
    "Measurement",
    "Record",
    "Recording",
    "Signal",
    "SpecError",
    "Stream",
    "Verified",
    "__version__",
    "align",
    "analyze",
    "bessel",
    "butterworth",
    "calibrate",
    "cascade",
    "chebyshev1",
    "chebyshev2",
    "design",
    "elliptic",
    "import_taps",
    "load",
    "measure",
    "rc",
    "read",
    "simulate",
    "ss",
    "tf",
    "verify",
    "zpk",
]

__version__: str

_Path: TypeAlias = str | PathLike[str]
_Spec: TypeAlias = _Path | Mapping[str, Any]
_Filter: TypeAlias = dict[str, Any]
_Quantity: TypeAlias = float | str | np.number[Any]
_Cutoff: TypeAlias = _Quantity | Sequence[_Quantity] | NDArray[Any]
_Values: TypeAlias = _Quantity | Sequence[_Quantity] | NDArray[Any]
_Files: TypeAlias = _Path | Sequence[_Path]
_Readings: TypeAlias = str | PathLike[str] | Sequence[Mapping[str, Any] | Record]
_Algorithm: TypeAlias = Literal["auto", "direct", "overlap-save"]
_Matrix: TypeAlias = NDArray[np.float64]

class HybankError(ValueError): ...

class Record(SimpleNamespace):
    def __init__(self, *args: Any, **fields: Any) -> None: ...
    # The names are those of a report.
    def __getattr__(self, name: str) -> Any: ...
    def __getitem__(self, name: str) -> Any: ...
    def __iter__(self) -> Iterator[str]: ...
    def __len__(self) -> int: ...
    def keys(self) -> KeysView[str]: ...

class Comparison(Record):
    def plot(self, ax: Any = None) -> Any: ...

class Captures:
    __match_args__ = ("channels", "rate", "output_rate")
    channels: Any
    rate: float | None
    output_rate: float | None
    def __init__(self, channels: Any, rate: float | None, output_rate: float | None = None) -> None: ...
    def __len__(self) -> int: ...
    def mono(self) -> NDArray[Any]: ...

class SpecError(HybankError):
    path: str
    line: int | None
    column: int | None

@final
class Gamma:
    @property
    def norm(self) -> float | None: ...
    @property
    def upper(self) -> float | None: ...
    @property
    def lower(self) -> float | None: ...
    @property
    def noncausal(self) -> float | None: ...
    @property
    def worst_case(self) -> float | None: ...
    @property
    def tracked(self) -> float | None: ...

@final
class Figures:
    @property
    def band(self) -> tuple[float, float]: ...
    @property
    def snr(self) -> float: ...
    @property
    def snr_signal(self) -> float: ...
    @property
    def snr_noise(self) -> float | None: ...
    @property
    def snr_delays(self) -> float | None: ...
    @property
    def snr_16_bits(self) -> float | None: ...
    @property
    def image(self) -> float | None: ...
    @property
    def image_frequency(self) -> float | None: ...
    @property
    def gain_error(self) -> float | None: ...
    @property
    def gain_error_frequency(self) -> float | None: ...
    @property
    def simple(self) -> list[tuple[Literal["one-channel", "interleaving", "cubic-spline"], int | None, float]]: ...
    @property
    def gain_over_simple(self) -> float | None: ...
    @property
    def any_input(self) -> float | None: ...

@final
class FuseReport:
    @property
    def algorithm(self) -> str: ...
    @property
    def numbers(self) -> str: ...
    @property
    def isa(self) -> str: ...
    @property
    def latency_dropped(self) -> int: ...
    @property
    def clipped(self) -> int: ...
    @property
    def replaced(self) -> int: ...
    @property
    def state_resets(self) -> int: ...
    @property
    def missing(self) -> int | None: ...
    @property
    def gaps(self) -> list[tuple[int, int, int]] | None: ...
    @property
    def mask(self) -> NDArray[np.bool_] | None: ...
    @property
    def track(self) -> list[Record] | None: ...

@final
class Verified:
    @property
    def lower(self) -> float: ...
    @property
    def lower_banks(self) -> Literal["any", "causal", "fir_of_this_length"]: ...
    @property
    def upper(self) -> float: ...
    @property
    def attained(self) -> float: ...
    @property
    def noncausal(self) -> float: ...
    @property
    def states(self) -> int: ...
    @property
    def digest(self) -> bool | None: ...
    @property
    def certificate_in_bank(self) -> bool: ...

@final
class Analysis:
    @property
    def gamma(self) -> float: ...
    @property
    def peak_hertz(self) -> float: ...
    @property
    def noncausal(self) -> float | None: ...
    @property
    def rms_error(self) -> float: ...
    @property
    def noise_gain(self) -> float: ...
    @property
    def output_noise(self) -> float: ...
    @property
    def scale(self) -> Record: ...
    @property
    def certified(self) -> Record | None: ...
    @property
    def worst_case(self) -> Record | None: ...
    @property
    def sensitivity(self) -> Record | None: ...
    @property
    def jitter(self) -> Record | None: ...
    @property
    def sweep(self) -> Record | None: ...

@final
class Capture:
    @property
    def channels(self) -> Any: ...
    @property
    def target(self) -> NDArray[Any]: ...
    @property
    def clipped(self) -> list[int]: ...

@final
class Recording:
    def __new__(cls, path: _Path) -> Recording: ...
    @property
    def frames(self) -> int: ...
    @property
    def channels(self) -> int: ...
    @property
    def rate(self) -> float | None: ...
    @property
    def dtype(self) -> Literal["f4", "f8", "c8", "c16"]: ...
    def read(self, first: int, count: int) -> NDArray[Any]: ...

@final
class Alignment:
    @property
    def spec(self) -> str: ...
    @property
    def skip(self) -> list[int]: ...
    @property
    def frames(self) -> int: ...
    @property
    def delay(self) -> NDArray[np.float64]: ...
    @property
    def drift_ppm(self) -> NDArray[np.float64]: ...
    @property
    def gain(self) -> NDArray[np.float64]: ...
    @property
    def offset(self) -> NDArray[np.float64]: ...
    @property
    def track(self) -> str: ...
    @property
    def alone_db(self) -> float: ...
    @property
    def together_db(self) -> float: ...
    @property
    def one_suffices(self) -> bool: ...
    @property
    def warnings(self) -> list[str]: ...

@final
class Calibration:
    @property
    def spec(self) -> str: ...
    @property
    def delay(self) -> NDArray[np.float64]: ...
    @property
    def delay_sigma(self) -> NDArray[np.float64]: ...
    @property
    def gain(self) -> NDArray[np.float64]: ...
    @property
    def gain_sigma(self) -> NDArray[np.float64]: ...
    @property
    def offset(self) -> NDArray[np.float64]: ...
    @property
    def offset_sigma(self) -> NDArray[np.float64]: ...
    @property
    def cutoff(self) -> NDArray[np.float64]: ...
    @property
    def cutoff_sigma(self) -> NDArray[np.float64]: ...
    @property
    def reference(self) -> int: ...
    @property
    def tones(self) -> list[float]: ...
    @property
    def frames(self) -> int: ...
    @property
    def clipped(self) -> list[int]: ...
    @property
    def misfit(self) -> float | None: ...
    @property
    def warnings(self) -> list[str]: ...

@final
class Measurement:
    @property
    def sinad(self) -> float: ...
    @property
    def enob(self) -> float: ...
    @property
    def enob_full_scale(self) -> float: ...
    @property
    def snr(self) -> float: ...
    @property
    def thd(self) -> float: ...
    @property
    def interleaving(self) -> float | None: ...
    @property
    def sfdr(self) -> float: ...
    @property
    def noise_density(self) -> float: ...
    @property
    def offset(self) -> float | complex: ...
    @property
    def tones(self) -> list[tuple[float, float, float]]: ...
    @property
    def spurs(self) -> list[tuple[float, float, str]]: ...
    @property
    def imbalances(self) -> list[tuple[float, float, float]] | None: ...
    @property
    def clipped(self) -> int: ...
    @property
    def left_out(self) -> int: ...
    @property
    def figures(self) -> list[tuple[str, str, str, str]]: ...
    @property
    def spectrum(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def plot(self, ax: Any = None) -> Any: ...
    def _repr_html_(self) -> str: ...

@final
class Bank:
    @staticmethod
    def from_json(text: str) -> Bank: ...
    def to_json(self) -> str: ...
    def save(self, path: _Path, *, overwrite: bool = True) -> None: ...
    def export(
        self,
        path: _Path,
        *,
        format: Literal["c", "c99", "csv", "npz", "mat", "coe", "mem", "sos", "verilog"],
        name: str = "bank",
        input_bits: int | None = None,
        overwrite: bool = True,
    ) -> None: ...
    @property
    def channels(self) -> int: ...
    @property
    def samples(self) -> list[int]: ...
    @property
    def ratio(self) -> int: ...
    @property
    def latency(self) -> int: ...
    @property
    def fast_period(self) -> float: ...
    @property
    def fast_rate(self) -> float: ...
    @property
    def noise_gain(self) -> float: ...
    @property
    def method(self) -> Literal["fir", "iir", "h2", "sinc", "separation"]: ...
    @property
    def proven(self) -> bool: ...
    @property
    def spec(self) -> str | None: ...
    @property
    def gamma(self) -> Gamma: ...
    @property
    def delays(self) -> NDArray[np.float64]: ...
    @property
    def gains(self) -> NDArray[np.float64]: ...
    @property
    def offsets(self) -> NDArray[np.float64]: ...
    @property
    def taps(self) -> _Matrix | None: ...
    @property
    def ss(self) -> tuple[_Matrix, _Matrix, _Matrix, _Matrix]: ...
    def figures(self) -> Figures: ...
    def error_response(self, n: int = 512) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def frequency_response(self, n: int = 512) -> tuple[NDArray[np.float64], NDArray[np.complex128]]: ...
    def front_end_gains(self, n: int = 512) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def pictures(self) -> dict[str, dict[str, Any]]: ...
    def plot(self, ax: Any = None, picture: str = "error") -> Any: ...
    def report(self, path: _Path, captures: Any = None, *, axis: int = -1, overwrite: bool = True) -> None: ...
    @overload
    def fuse(
        self,
        x: ArrayLike | _Files | Captures,
        *,
        axis: int = -1,
        dtype: DTypeLike | None = None,
        threads: int = 1,
        gaps: Literal["hold", "zero"] | None = None,
        algorithm: _Algorithm = "auto",
        keep_latency: bool = False,
        interleaved: int | None = None,
        track: _Readings | None = None,
        track_frames: int = 2048,
        track_wander: float = 1.0,
        rate: float | None = None,
        full_output: Literal[False] = False,
    ) -> NDArray[Any]: ...
    @overload
    def fuse(
        self,
        x: ArrayLike | _Files | Captures,
        *,
        axis: int = -1,
        dtype: DTypeLike | None = None,
        threads: int = 1,
        gaps: Literal["hold", "zero"] | None = None,
        algorithm: _Algorithm = "auto",
        keep_latency: bool = False,
        interleaved: int | None = None,
        track: _Readings | None = None,
        track_frames: int = 2048,
        track_wander: float = 1.0,
        rate: float | None = None,
        full_output: Literal[True],
    ) -> tuple[NDArray[Any], FuseReport]: ...
    def stream(
        self,
        *,
        axis: int = -1,
        dtype: DTypeLike | None = None,
        algorithm: _Algorithm = "auto",
        state: bytes | None = None,
        gaps: Literal["hold", "zero"] | None = None,
        track: _Readings | None = None,
        track_frames: int = 2048,
        track_wander: float = 1.0,
        rate: float | None = None,
    ) -> Stream: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __copy__(self) -> Bank: ...
    def __deepcopy__(self, _memo: dict[int, Any]) -> Bank: ...
    def _repr_html_(self) -> str: ...

@final
class Stream:
    def process(self, x: ArrayLike) -> NDArray[Any]: ...
    def flush(self) -> NDArray[Any]: ...
    def reset(self) -> None: ...
    @property
    def channels(self) -> int: ...
    @property
    def ratio(self) -> int: ...
    @property
    def latency(self) -> int: ...
    @property
    def memory(self) -> int | None: ...
    @property
    def alignment(self) -> int: ...
    @property
    def algorithm(self) -> str: ...
    @property
    def position(self) -> int: ...
    @property
    def replaced(self) -> int: ...
    @property
    def clipped(self) -> int: ...
    @property
    def state_resets(self) -> int: ...
    @property
    def gaps(self) -> list[tuple[int, int, int]] | None: ...
    @property
    def mask(self) -> NDArray[np.bool_] | None: ...
    @property
    def track(self) -> list[Record] | None: ...
    @property
    def state(self) -> bytes: ...
    def agrees(self, state: bytes) -> bool: ...
    def __copy__(self) -> Stream: ...
    def __enter__(self) -> Stream: ...
    def __exit__(self, *_exception: type[BaseException] | BaseException | TracebackType | None) -> None: ...

class Channel(dict[str, Any]):
    def __init__(
        self,
        delay: _Quantity | None = None,
        filter: _Filter | None = None,
        *,
        delay_samples: float | np.number[Any] | None = None,
        rate: _Quantity | None = None,
        noise: float | np.number[Any] | None = None,
        bits: int | np.integer[Any] | None = None,
        jitter: _Quantity | None = None,
        gain: float | np.number[Any] | None = None,
        offset: float | np.number[Any] | None = None,
    ) -> None: ...

class Signal(dict[str, Any]):
    def __init__(
        self,
        band: _Cutoff | None = None,
        filter: _Filter | None = None,
        *,
        floor_db: float | np.number[Any] | None = None,
        rms: float | np.number[Any] | None = None,
    ) -> None: ...

@overload
def design(
    source: _Spec,
    /,
    *,
    replace: Mapping[str, Any] | None = None,
    proof: bool = True,
    limits: bool = True,
    progress: Callable[[str, float], object] | None = None,
) -> Bank: ...
@overload
def design(
    source: None = None,
    /,
    *,
    name: str | None = None,
    fast_rate: _Quantity | None = None,
    fast_period: _Quantity | None = None,
    ratio: int | np.integer[Any] | None = None,
    latency: int | np.integer[Any] | None = None,
    target: Mapping[str, Any] | None = None,
    channels: Iterable[Mapping[str, Any]] | None = None,
    channel: Iterable[Mapping[str, Any]] | None = None,
    signal: _Cutoff | Mapping[str, Any] | None = None,
    uncertainty: Mapping[str, Any] | None = None,
    full_scale: float | str | None = None,
    fit: str | Sequence[str] | None = None,
    design: Mapping[str, Any] | None = None,
    method: Literal["fir", "iir", "h2", "sinc", "separation"] | None = None,
    taps: int | np.integer[Any] | None = None,
    target_snr_db: float | np.number[Any] | None = None,
    gamma_margin: float | np.number[Any] | None = None,
    bits: int | Sequence[int] | np.integer[Any] | NDArray[Any] | None = None,
    fraction_bits: int | np.integer[Any] | None = None,
    loss_db: float | np.number[Any] | None = None,
    digits: bool | None = None,
    order: int | np.integer[Any] | None = None,
    reduction_loss_db: float | np.number[Any] | None = None,
    noise: float | np.number[Any] | None = None,
    tracking: Literal["affine"] | None = None,
    proof: bool = True,
    limits: bool = True,
    progress: Callable[[str, float], object] | None = None,
) -> Bank: ...
def import_taps(spec: Bank | _Spec, taps: ArrayLike, *, latency: int | None = None, proof: bool = True) -> Bank: ...
def load(path: _Path) -> Bank: ...
def read(
    files: _Files,
    *,
    bank: Bank | None = None,
    format: str = "wav",
    channels: int | None = None,
    channel: int | None = None,
    full_scale: float | str | None = None,
    sample_bits: int | None = None,
    interleaved: int | None = None,
    lost: _Path | None = None,
    max_lost: int | None = None,
    longest: bool = False,
) -> Captures: ...
def verify(bank: Bank | _Path, *, search: bool = False) -> Verified: ...
def analyze(
    bank: Bank | _Path,
    *,
    delay_error: _Values | None = None,
    certify: bool = False,
    delay_box: _Values | None = None,
    gain_box: _Values | None = None,
    cutoff_box: _Values | None = None,
    jitter: _Values | None = None,
    reference: int | Literal["none"] | None = None,
    accuracy: float | str | None = None,
    sensitivity: bool = False,
    sweep: bool = False,
) -> Analysis: ...
def align(
    x: Sequence[ArrayLike] | NDArray[Any],
    spec: Bank | _Spec,
    *,
    reference: int | None = None,
    within: float | None = None,
) -> Alignment: ...
def calibrate(
    x: ArrayLike | _Files | Captures,
    spec: Bank | _Spec,
    *,
    tones: _Values | None = None,
    waveform: Sequence[float] | NDArray[Any] | None = None,
    rate: float | None = None,
    blind: bool = False,
    fit: Sequence[str] = ("delay", "gain", "offset"),
    reference: int | None = None,
    clip: float | None = None,
    interleaved: int | None = None,
    axis: int = -1,
) -> Calibration: ...
@overload
def measure(
    y: ArrayLike | _Path | Captures,
    rate: float | None = None,
    *,
    ref: None = None,
    tones: _Values | None = None,
    interleaved: int = 1,
    harmonics: int = 10,
    full_scale: float = 1.0,
    window: Literal["none", "hann", "bh4", "bh7"] = "bh7",
    skip: int = 0,
) -> Measurement: ...
@overload
def measure(
    y: ArrayLike | _Path | Captures,
    rate: float | None = None,
    *,
    ref: ArrayLike | _Path | Captures,
    tones: None = None,
    interleaved: int = 1,
    harmonics: int = 10,
    full_scale: float = 1.0,
    window: Literal["none", "hann", "bh4", "bh7"] = "bh7",
    skip: int = 0,
) -> Comparison: ...
def simulate(
    source: Bank | _Spec,
    signal: str | PathLike[str] | Sequence[complex] | NDArray[Any],
    *,
    imaginary: str | Sequence[float] | NDArray[Any] | None = None,
    channel: int | None = None,
    samples: int | None = None,
    gain: float = 1.0,
    rate: float | None = None,
    noise: float = 0.0,
    bits: int | None = None,
    jitter: float | str | None = None,
    drift: float | Sequence[float] | NDArray[Any] | None = None,
    delay_error: _Values | None = None,
    gain_error: _Values | None = None,
    cutoff_error: _Values | None = None,
    offset: float | Sequence[float] | NDArray[Any] | None = None,
    seed: int = 0,
) -> Capture: ...
def butterworth(order: int, cutoff: _Cutoff) -> _Filter: ...
def chebyshev1(order: int, cutoff: _Cutoff, ripple_db: float) -> _Filter: ...
def chebyshev2(order: int, cutoff: _Cutoff, attenuation_db: float) -> _Filter: ...
def elliptic(order: int, cutoff: _Cutoff, ripple_db: float, attenuation_db: float) -> _Filter: ...
def bessel(order: int, cutoff: _Cutoff) -> _Filter: ...
def rc(cutoff: _Cutoff) -> _Filter: ...
def tf(num: ArrayLike, den: ArrayLike) -> _Filter: ...
def zpk(zeros: Iterable[Any], poles: Iterable[Any], gain: float) -> _Filter: ...
def ss(a: ArrayLike, b: ArrayLike, c: ArrayLike) -> _Filter: ...
def cascade(*stages: _Filter) -> _Filter: ...
