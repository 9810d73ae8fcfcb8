"""The reasons for which frames have no result or an incomplete one: the only list of them."""
from __future__ import annotations

from enum import Enum


class Reason(Enum):
    """
    A reason to reject a frame, or to omit one of its outputs.

    Attributes
    ----------
    phrase
        Name of the reason in the log and in diagnostics, which count frames by it.
    meaning
        Description of the reason in the documentation, Markdown.

    """

    UNKNOWN_ENCODING = ('unknown encoding', 'the encoding is not one of those above; the log '
                        'lists them')
    WRONG_SIZE = ('wrong size', 'width or height is 0 or above 32768, or the image has more than '
                  '`max_pixels` pixels; this is checked before an image is decoded')
    STEP_TOO_SMALL = 'step too small', '`step` is less than the bytes of a row of pixels'
    DATA_TOO_SHORT = 'data too short', '`data` has less than `step` x height bytes'
    NO_IMAGE = 'cannot be decoded', 'a compressed image is damaged, or neither JPEG nor PNG'
    TOO_MANY_SCANS = ('too many scans', 'decoding a progressive JPEG would take minutes: the '
                      'number of its scans times its pixels is above 2^32')
    REGION_OUTSIDE = 'region outside', '`roi_x` or `roi_y` lies outside the image'
    OTHER_MASK = ('mask of another size',
                  'the width or height of the file `mask` differs from that of the image')
    NO_LENS = ('no lens', 'the image has no `~/camera_info` and `~/rectified`: the parameter '
               '[`lens`](#the-lens) is off, or the lens is not known yet')
    NO_CALIBRATION = ('no camera_info', 'the image has no `~/planes`, since no `camera_info` has '
                      'arrived beside `image`; all other topics are published')
    OTHER_CALIBRATION = ('camera_info of another size', 'the image has no `~/planes`, since '
                         '`camera_info` is for images of another size; the log has both sizes')
    BAD_CALIBRATION = ('camera_info of no use', 'the image has no `~/planes`, since the model of '
                       '`camera_info` is unknown or its numbers are invalid; the log has details')
    INTERNAL = ('internal error', 'an error of this package; please report it with the traceback '
                'in the log')

    def __init__(self, phrase: str, meaning: str) -> None:
        self.phrase, self.meaning = phrase, meaning


def markdown_table() -> str:
    """Return the table of all reasons for the documentation, in Markdown."""
    rows = [f'| `{reason.phrase}` | {reason.meaning} |' for reason in Reason]
    return '\n'.join(['| reason | meaning |', '|---|---|', *rows])
