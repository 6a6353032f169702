"""Reference example: a thesis on the DVF5000, its printed numbers beside the computed ones.

The package registers itself as any plug-in does; nothing below imports it.
"""

from warpspace.analysis.publications import PUBLICATIONS, Publication
from warpspace.thesis_example.printed import key_errors, measured_error, sampled_mean

PUBLICATIONS.register(
    Publication(
        name="thesis",
        key_errors=key_errors,
        sampled_mean=sampled_mean,
        measured_error=measured_error,
    )
)
