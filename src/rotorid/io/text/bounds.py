"""How large input may be: beyond these it is refused in one sentence, before it fills the memory or takes minutes.

Each is several times what a sound recording needs. All stand here, so that one can be compared with the others.
"""

from __future__ import annotations

# Text that people write -----------------------------------------------------------------------------

LARGEST_YAML = 1_000_000
"""Bytes of a YAML file: that of a vehicle has some thousand."""
DEEPEST_YAML = 50
"""Levels of a YAML file: a vehicle has three, and the reader descends by calling itself."""
MOST_YAML_VALUES = 20_000
"""Values of a YAML file with all its aliases written out: nine lines of aliases can stand for a thousand million."""

# Recording sets -------------------------------------------------------------------------------------

LARGEST_FILE = 2_500_000_000
"""Bytes of a run or a log: an hour at 1 kHz with forty columns has one and a half thousand million as text."""
MOST_ROWS = 5_000_000
"""Samples of a run: 83 minutes at 1 kHz; the analysis of more takes a day."""
MOST_CELLS = 200_000_000
"""Cells of a run, and of all runs of a set: 1.6 GB as floats; an hour at 1 kHz with forty columns has 144 million."""
MOST_RUNS = 1000
"""Runs of a set: a whole campaign on bench and stand has 811 recordings, a vehicle some tens of flights."""
LEAST_UNPACKED = 100_000_000
"""Bytes that any packed file may unpack to: less is no danger."""
MOST_UNPACKED = 60
"""Times its own size that a larger packed file may unpack to: logs have 2 to 10, a bomb a thousand."""
MOST_GZIP_MEMBERS = 20_000
"""Parts of a gzipped file: programs that pack in blocks write one for each 64 kB, and each costs a start."""
LONGEST_JUMP_S = 1800.0
"""Seconds from one sample of a run to the next: pauses are shorter, a clock set to summer time jumps by 3600."""
MOST_GRID, MOST_HOLES = 500_000, 20
"""Steps of the even grid a run is resampled to: that many, or so many times its samples where it has more of them."""

# Logs of autopilots and instruments -----------------------------------------------------------------

LEAST_MEMORY, MEMORY_TIMES_FILE = 1_000_000_000, 100
"""Bytes of memory that reading a log may take: that many, or so many times its own size where that is more."""
LARGEST_RAW_LOG = 256_000_000
"""Bytes of an unpacked raw log: ten hours of the bench at 100 Hz have 110 MB."""
MOST_TRIED_BYTES = 300_000_000
"""Bytes whose checksum is computed in vain behind damaged places of a raw log: about a second."""
LARGEST_INDEX = 100_000_000
"""Bytes of the index of recordings: 811 recordings have 0.2 MB."""
LARGEST_METADATA, MOST_METADATA_VALUES = 10_000_000, 200_000
"""Bytes and values of a recording's metadata: a program writes them, with a line for each step of its plan."""
LARGEST_CHECKPOINT = 100_000_000
"""Bytes of a network's arrays: the largest network here has 0.1 MB."""
