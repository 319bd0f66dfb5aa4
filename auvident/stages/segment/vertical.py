"""placeholder"""

from auvident.stages.segment.stage import *

segment_vertical = None
