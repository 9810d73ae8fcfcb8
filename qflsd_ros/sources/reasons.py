"""The reasons for which frames give no result, or an incomplete one."""
from __future__ import annotations

from enum import Enum


class Reason(Enum):
    """
    A reason to reject a frame.

    Attributes
    ----------
    phrase
        Its short name, by which diagnostics count frames and which begins lines of the log.
    meaning
        Its explanation in the table of doc/troubleshooting.md.

    """

    UNKNOWN_ENCODING = ('unknown encoding', 'not one of the [encodings](messages.md#encodings) '
                        'that the node reads; the log lists them')
    WRONG_SIZE = ('wrong size', 'width or height is 0 or above 32768, or there are more than '
                  '`max_pixels` pixels; seen before an image is decoded')
    STEP_TOO_SMALL = 'step too small', 'less than a row of pixels takes'
    DATA_TOO_SHORT = 'data too short', 'less than `step` x height bytes'
    NO_IMAGE = 'cannot be decoded', 'a compressed image that is damaged, or neither JPEG nor PNG'
    TOO_MANY_SCANS = ('too many scans', 'a progressive JPEG whose decoding would take minutes: '
                      'its scans times its pixels are above 2^32')
    REGION_OUTSIDE = 'region outside', '`roi_x` or `roi_y` lies outside the image'
    OTHER_MASK = ('mask of another size',
                  'the file `mask` has not as many pixels as the image')
    NO_LENS = ('no lens', 'no `~/camera_info` and `~/rectified` for this image: the '
               '[lens](lens.md) is off, or not known yet')
    NO_CALIBRATION = ('no camera_info', 'no `~/planes` and `~/line_features` for this image: none '
                      'has come beside `image`; all else is published')
    OTHER_CALIBRATION = ('camera_info of another size', 'the same: it belongs to images of '
                         'another size; the log names both')
    BAD_CALIBRATION = ('camera_info of no use', 'the same: its model is unknown, or its numbers '
                       'belong to no camera; the log says which')
    NO_TRACKS = ('no tracks', 'no `~/line_features` for this image: parameter `tracking` is '
                 'false, or the method is not `arcs`')
    NO_ATTITUDE = ('no attitude', 'no `~/attitude` and `~/gravity` for this image: parameter '
                   '`attitude` is false, or its arcs do not show [up](attitude.md); the log says '
                   'why')
    INTERNAL = ('internal error', 'an error of this package; the log has the traceback: please '
                'report it')

    def __init__(self, phrase: str, meaning: str) -> None:
        self.phrase, self.meaning = phrase, meaning


def markdown_table() -> str:
    """Return a table of all reasons."""
    rows = [f'| `{reason.phrase}` | {reason.meaning} |' for reason in Reason]
    return '\n'.join(['| reason | what it is |', '|---|---|', *rows])
