"""What every SLAM back end asks of the frames that it is given."""

from dotmask.records import Intrinsics, MaskedDepth, RgbdFrame


def check_next_frame(frame: RgbdFrame, masked: MaskedDepth, intrinsics: Intrinsics, last_time_s: float | None) -> None:
    """Refuse a frame that does not continue the sequence.

    Args:
        frame: the next one.
        masked: its depth images.
        intrinsics: of all frames.
        last_time_s: time of the frame before; None for the first.

    Raises:
        ValueError: the frame has other intrinsics, the masked depth another size, or the time does not rise.
    """
    if frame.intrinsics != intrinsics:
        raise ValueError(f"frame {frame.index}: its intrinsics are not those the back end was made for")
    if masked.mo_mdi_m.shape != frame.depth_m.shape:
        raise ValueError(f"frame {frame.index}: masked depth of {masked.mo_mdi_m.shape}, not {frame.depth_m.shape}")
    if last_time_s is not None and frame.timestamp_s <= last_time_s:
        raise ValueError(f"frame {frame.index}: time {frame.timestamp_s} is not after {last_time_s}")
