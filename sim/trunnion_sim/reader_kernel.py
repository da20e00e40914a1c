"""The byte loop of the reader: one pass over the text, no allocation, about 100 MB/s.

A line is `[N<int>] <letter><number> {<letter>[<number>]} [*<checksum>] [; comment]`. Numbers are fixed point, without
exponent, as the parsers of Marlin (`gcode/parser.cpp`) and RepRapFirmware (`GCodes/GCodeBuffer/StringParser.cpp`)
take them.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

JUNK = 1
"""A character that belongs to no word."""
BARE = 2
"""A letter without a number."""
REPEATED = 4
"""The same letter twice."""
LOWER = 8
"""A lower-case letter."""
NAMED = 16
"""A command that is a word and not a letter with a number."""
BAD_CHECKSUM = 32
HUGE = 64
"""A number beyond `HUGE_NUMBER`, or with more digits than any machine can mean."""
BINARY = 128
"""NUL, control characters or bytes above 126 outside comments."""
OVERLONG = 256
"""Too long to be read at all; the rest of the line was skipped."""
NO_COMMAND = 512
"""Words without a command in front of them."""
MALFORMED = 1024
"""A number that is none: two points, a sign alone, a lone point."""

HUGE_NUMBER = 1e7

_TEXT_CODES = np.array(
    [0, 10, 1150, 1170, 1180, 230, 280, 300, 320, 330, 160, 9280, 2910, 2920, 980, 360, 370, 4860, 8620], np.int64
)
"""M codes (times ten) whose rest of the line is free text."""


@njit(cache=True)
def parse(
    data: NDArray[np.uint8],
    first_line: int,
    longest: int,
    line: NDArray[np.int64],
    letter: NDArray[np.uint8],
    code: NDArray[np.int64],
    flags: NDArray[np.int64],
    length: NDArray[np.int64],
    word_start: NDArray[np.int64],
    word_letter: NDArray[np.uint8],
    word_value: NDArray[np.float64],
    comment: NDArray[np.int64],
) -> tuple[int, int, int]:
    """Fill the arrays from whole lines; returns how many commands, words and comments were found."""
    n = len(data)
    m = 0
    w = 0
    c = 0
    at = 0
    number = first_line
    while at < n:
        stop = at
        while stop < n and data[stop] != 10:
            stop += 1
        text_end = stop
        if text_end > at and data[text_end - 1] == 13:
            text_end -= 1
        flag = 0
        if text_end - at > longest:
            flag = OVERLONG
            text_end = at
        # where the comment starts
        semicolon = at
        quoted = False
        while semicolon < text_end:
            ch = data[semicolon]
            if ch == 34:
                quoted = not quoted
            elif ch == 59 and not quoted:
                break
            semicolon += 1
        command_end = semicolon
        while command_end > at and (data[command_end - 1] == 32 or data[command_end - 1] == 9):
            command_end -= 1
        start = at
        while start < command_end and (data[start] == 32 or data[start] == 9):
            start += 1
        if semicolon < text_end and semicolon + 1 < text_end:
            first = data[semicolon + 1]
            own_line = start >= command_end
            # `;KEY` everywhere; anything else only where the comment has the line for itself
            if own_line or (65 <= first <= 90):
                comment[c, 0] = number
                comment[c, 1] = semicolon + 1
                comment[c, 2] = min(text_end, semicolon + 1 + 300)
                c += 1
        if start < command_end or flag:
            letter_found, code_found, flag, w = _command(data, start, command_end, flag, word_letter, word_value, w)
            line[m] = number
            letter[m] = letter_found
            code[m] = code_found
            flags[m] = flag
            length[m] = command_end - start if not flag & OVERLONG else stop - at
            m += 1
            word_start[m] = w
        number += 1
        at = stop + 1
    return m, w, c


@njit(cache=True)
def _command(
    data: NDArray[np.uint8],
    at: int,
    end: int,
    flag: int,
    word_letter: NDArray[np.uint8],
    word_value: NDArray[np.float64],
    w: int,
) -> tuple[int, int, int, int]:
    """One command; returns its letter, code, flags and the count of words so far."""
    letter = 0
    code = -1
    first = w
    begin = at
    seen = np.int64(0)
    while at < end:
        ch = data[at]
        if ch == 32 or ch == 9:
            at += 1
            continue
        if ch == 40:  # ( a comment in brackets )
            while at < end and data[at] != 41:
                at += 1
            at += 1
            continue
        if ch == 34:  # "a text"
            at += 1
            while at < end and data[at] != 34:
                at += 1
            at += 1
            continue
        if ch == 123:  # {an expression}
            while at < end and data[at] != 125:
                at += 1
            at += 1
            continue
        if ch == 42:  # *checksum
            total = 0
            for k in range(begin, at):
                total ^= data[k]
            value, at, state = _number(data, at + 1, end)
            if state != 0 or value != total:
                flag |= BAD_CHECKSUM
            continue
        if 97 <= ch <= 122:
            flag |= LOWER
            ch -= 32
        if ch < 65 or ch > 90:
            flag |= BINARY if (ch < 32 or ch > 126) else JUNK
            at += 1
            continue
        after = at + 1
        if letter == 0 and after < end and _is_name(data, after, end):
            return ch, -1, flag | NAMED, first
        value, after, state = _number(data, after, end)
        at = after
        if state == 2:
            flag |= MALFORMED
        elif state == 3 or abs(value) > HUGE_NUMBER:
            flag |= HUGE
        if ch == 78 and letter == 0 and state == 0:  # line number
            continue
        if letter == 0:
            letter = ch
            if ch == 71 or ch == 77 or ch == 84:
                code = -1 if state != 0 or not 0 <= value < 1e5 else int(np.floor(value * 10 + 0.5))
                if ch == 77 and np.any(code == _TEXT_CODES):
                    return letter, code, flag, w
                continue
            flag |= NO_COMMAND
        bit = np.int64(1) << (ch - 65)
        if seen & bit:
            flag |= REPEATED
        seen |= bit
        if state == 1:
            flag |= BARE
        word_letter[w] = ch
        word_value[w] = value
        w += 1
    return letter, code, flag, w


@njit(cache=True)
def _is_name(data: NDArray[np.uint8], at: int, end: int) -> bool:
    """Whether a letter is followed by another letter or an underscore, as in SET_PIN."""
    ch = data[at]
    return bool((65 <= ch <= 90) or (97 <= ch <= 122) or ch == 95)


@njit(cache=True)
def _number(data: NDArray[np.uint8], at: int, end: int) -> tuple[float, int, int]:
    """A fixed-point number: value, where it ends, and 0 good, 1 none there, 2 malformed, 3 too many digits."""
    while at < end and (data[at] == 32 or data[at] == 9):
        at += 1
    begin = at
    negative = False
    if at < end and (data[at] == 45 or data[at] == 43):
        negative = data[at] == 45
        at += 1
    mantissa = np.int64(0)
    digits = 0
    decimals = 0
    points = 0
    seen = 0
    while at < end:
        ch = data[at]
        if ch == 46:
            points += 1
        elif 48 <= ch <= 57:
            seen += 1
            if digits < 18:
                mantissa = mantissa * 10 + (ch - 48)
                if mantissa > 0:
                    digits += 1
                if points:
                    decimals += 1
            elif not points:
                digits = 99
        else:
            break
        at += 1
    if at == begin:
        return np.nan, at, 1
    if seen == 0 or points > 1:
        return np.nan, at, 2
    value = mantissa / 10.0**decimals
    if negative:
        value = -value
    return value, at, 3 if digits == 99 else 0
