"""From pictures to a film, one at a time: each is handed to ffmpeg as soon as it is drawn, and nothing is kept."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dexplan.errors import RenderError
from dexplan.viz.canvas import SOFTWARE
from dexplan.viz.film import QUALITIES, FilmOptions

GIF = ".gif"


@dataclass(frozen=True)
class Encoding:
    """Where a film goes: the encoder's program, the path, and the container by its suffix, ``.mp4`` or ``.gif``."""

    ffmpeg: str
    path: str
    container: str


def find_encoder() -> str:
    """Return the path of an ffmpeg.  Raises RenderError where there is none."""
    import imageio_ffmpeg

    try:
        encoder = str(imageio_ffmpeg.get_ffmpeg_exe())
    except RuntimeError as error:
        raise RenderError(
            "no video encoder was found; install ffmpeg, or imageio-ffmpeg from a wheel that brings one"
        ) from error
    if shutil.which(encoder) is None:
        raise RenderError(
            f"the video encoder {encoder!r} is no program; unset IMAGEIO_FFMPEG_EXE or let it name an ffmpeg"
        )
    return encoder


def encode(pictures: Iterable[Any], options: FilmOptions, encoding: Encoding) -> None:
    """Write ``pictures`` (H, W, 4), rows from above, as a film.  Raises RenderError where the encoder refuses.

    For a GIF a film without loss is written into the working directory first: its colours are chosen for all of it, in two
    passes, for one would hold all pictures in memory.
    """
    is_gif = encoding.container == GIF
    film = "film.mkv" if is_gif else encoding.path
    with tempfile.TemporaryFile() as complaints:
        encoder = subprocess.Popen(
            [encoding.ffmpeg, *_write_command(options, is_gif), film],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=complaints,
        )
        assert encoder.stdin is not None
        try:
            for picture in pictures:
                encoder.stdin.write(picture.data)
            encoder.stdin.close()
        except BrokenPipeError:
            pass
        if encoder.wait() != 0:
            complaints.seek(0)
            _refuse("video", complaints.read())
    if is_gif:
        _turn_into_gif(encoding, film, options.fps)


def _write_command(options: FilmOptions, is_gif: bool) -> list[str]:
    """Return the encoder's command: RGBA on stdin to H.264, in BT.709 of limited range and tagged so; without loss for a GIF."""
    width, height = options.size
    quality = QUALITIES[options.quality]
    taken = f"-f rawvideo -pix_fmt rgba -s {width}x{height} -framerate {options.fps:g} -i -"
    if is_gif:
        given = "-an -c:v libx264rgb -preset ultrafast -qp 0 -f matroska"
        return f"-hide_banner -loglevel error -y {taken} {given}".split()
    tags = "setparams=range=tv:colorspace=bt709:color_primaries=bt709:color_trc=bt709"
    colours = f"scale=in_range=pc:out_range=tv:out_color_matrix=bt709,format=yuv420p,{tags}"
    given = f"-an -c:v libx264 -preset {quality.preset} -crf {quality.crf} -vf {colours} -movflags +faststart"
    given += f" -metadata comment={SOFTWARE} -f mp4"
    return f"-hide_banner -loglevel error -y {taken} {given}".split()


def _turn_into_gif(encoding: Encoding, film: str, fps: float) -> None:
    """Turn a film into a GIF: one palette for all of it, and of each picture only what changed."""
    palette = f"{film}.png"
    quiet = [encoding.ffmpeg, *["-hide_banner", "-loglevel", "error", "-y", "-i"], film]
    used = "[0:v][1:v]paletteuse=dither=none:diff_mode=rectangle"
    for command in (
        [*quiet, "-vf", "palettegen=stats_mode=full", palette],
        [*quiet, "-i", palette, "-lavfi", used, "-r", str(fps), "-loop", "0", "-f", "gif", encoding.path],
    ):
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
        if done.returncode != 0:
            _refuse("GIF", done.stderr)
    _sign_gif(Path(encoding.path))


def _sign_gif(path: Path) -> None:
    """Put a comment behind the palette of a GIF that says whose it is, by which a later film knows that it may replace it."""
    content = path.read_bytes()
    # A header of 6 bytes and a screen of 7, whose fifth tells how large the palette is that follows.
    end = 13 + (3 * 2 ** ((content[10] & 7) + 1) if content[10] & 0x80 else 0)
    mark = SOFTWARE.encode()
    path.write_bytes(content[:end] + b"\x21\xfe" + bytes([len(mark)]) + mark + b"\0" + content[end:])


def _refuse(what: str, complaint: bytes) -> None:
    lines = complaint.decode(errors="replace").strip().splitlines()
    raise RenderError(f"the {what} could not be encoded: {lines[-1] if lines else 'no reason given'}")
