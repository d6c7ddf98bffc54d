from collections.abc import Callable, Iterable, Mapping, Sequence
from os import PathLike
from types import TracebackType
from typing import Any, Literal, TypeAlias, final, overload

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from hybank._results import (
    Alignment as Alignment,
    Analysis as Analysis,
    Calibration as Calibration,
    Capture as Capture,
    Comparison as Comparison,
    Figures as Figures,
    FuseReport as FuseReport,
    Gamma as Gamma,
    Measurement as Measurement,
    Merged as Merged,
    Record as Record,
    Verified as Verified,
)

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
    "Merged",
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
    "merge",
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
_Algorithm: TypeAlias = Literal["auto", "direct", "overlap-save"]
_Matrix: TypeAlias = NDArray[np.float64]

class HybankError(ValueError): ...

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
class Bank:
    @staticmethod
    def from_json(text: str) -> Bank: ...
    def to_json(self) -> str: ...
    def save(self, path: _Path, *, overwrite: bool = True) -> None: ...
    def export(
        self,
        path: _Path,
        *,
        format: Literal["c", "csv", "mat", "coe", "mem", "sos", "verilog"] | None = None,
        name: str = "bank",
        input_bits: int | None = None,
        output_bits: int | None = None,
        accumulator: int | None = None,
        clocks_per_frame: int | None = None,
        frames_per_clock: int | None = None,
        pipeline: int | None = None,
        loadable: bool = False,
        testbench: _Path | None = None,
        random_frames: int | None = None,
        overwrite: bool = True,
    ) -> Record | None: ...
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
    def report(
        self,
        path: _Path,
        captures: Any = None,
        *,
        axis: int = -1,
        overwrite: bool = True,
        full_scale: float | str | None = None,
    ) -> None: ...
    @overload
    def fuse(
        self,
        x: ArrayLike | _Files | Captures,
        *,
        axis: int = -1,
        dtype: DTypeLike | None = None,
        threads: int = 1,
        gaps: bool = False,
        algorithm: _Algorithm = "auto",
        keep_latency: bool = False,
        interleaved: int | None = None,
        rate: float | None = None,
        full_output: Literal[False] = False,
        full_scale: float | str | None = None,
    ) -> NDArray[Any]: ...
    @overload
    def fuse(
        self,
        x: ArrayLike | _Files | Captures,
        *,
        axis: int = -1,
        dtype: DTypeLike | None = None,
        threads: int = 1,
        gaps: bool = False,
        algorithm: _Algorithm = "auto",
        keep_latency: bool = False,
        interleaved: int | None = None,
        rate: float | None = None,
        full_output: Literal[True],
        full_scale: float | str | None = None,
    ) -> tuple[NDArray[Any], FuseReport]: ...
    def fuse_as_hardware(
        self, x: NDArray[np.signedinteger[Any]], *, accumulator: int = 64, axis: int = -1, keep_latency: bool = False
    ) -> NDArray[np.signedinteger[Any]]: ...
    def stream(
        self,
        *,
        axis: int = -1,
        dtype: DTypeLike | None = None,
        algorithm: _Algorithm = "auto",
        state: bytes | None = None,
        gaps: bool = False,
        full_scale: float | str | None = None,
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
    def gaps(self) -> list[tuple[int, int, int, float]] | None: ...
    @property
    def mask(self) -> NDArray[np.bool_] | None: ...
    @property
    def state(self) -> bytes: ...
    def agrees(self, state: bytes) -> bool: ...
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
    limit: bool = True,
    progress: Callable[[str], object] | None = None,
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
    target_sfdr_db: float | np.number[Any] | None = None,
    gamma_margin: float | np.number[Any] | None = None,
    bits: int | Sequence[int] | np.integer[Any] | NDArray[Any] | None = None,
    fraction_bits: int | np.integer[Any] | None = None,
    loss_db: float | np.number[Any] | None = None,
    order: int | np.integer[Any] | None = None,
    reduction_loss_db: float | np.number[Any] | None = None,
    noise: float | np.number[Any] | None = None,
    proof: bool = True,
    limit: bool = True,
    progress: Callable[[str], object] | None = None,
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
    iq: bool = False,
    full_scale: float | str | None = None,
    interleaved: int | None = None,
    lost: _Path | None = None,
    max_lost: int | None = None,
    longest: bool = False,
    skip_lines: int = 0,
    columns: Sequence[int | str] | None = None,
    time_column: int | str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
) -> Captures: ...
def verify(bank: Bank | _Path, *, search: bool = False) -> Verified: ...
def analyze(
    bank: Bank | _Path,
    *,
    delay_error: _Values | None = None,
    delay_box: _Values | None = None,
    gain_box: _Values | None = None,
    cutoff_box: _Values | None = None,
    reference: int | Literal["none"] | None = None,
) -> Analysis: ...
def align(
    x: Sequence[ArrayLike] | ArrayLike | _Files | Captures,
    spec: Bank | _Spec,
    *,
    reference: int | None = None,
    within: float | None = None,
    axis: int = -1,
) -> Alignment: ...
def merge(
    x: Sequence[ArrayLike] | _Files,
    rate: float | Sequence[float] | None = None,
    *,
    times: Sequence[ArrayLike] | None = None,
    output_rate: float | None = None,
    band: float | None = None,
    flat: bool = False,
    within: float | None = None,
) -> Merged: ...
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
    full_scale: float | str | None = None,
    nonlinearity: int | str | None = None,
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
    full_scale: float | str | None = None,
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
    full_scale: float | str | None = None,
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
