"""From a command line to its letter, number and words (Marlin 2.1 `parser.cpp`)."""

import re
from dataclasses import dataclass

HEAD = re.compile(r" *(?:N[-\d]+ *)?([GMT]) *(\d+)(?:\.(\d+))?")
NUMBERED = re.compile(r" *N[-\d]+ *")
WORD = re.compile(r"([A-Z]) *([-+]?(?:\d+\.?\d*|\.\d+))?")


@dataclass(frozen=True)
class Command:
    """A parsed line. `words` maps a letter to its number, None where none follows."""

    code: str
    """Letter and number, with a subcode after a dot: "G1", "G43.4"."""
    words: dict[str, float | None]
    rest: str
    """What follows the code, verbatim: the text of M117 and the like."""

    def value(self, letter: str, default: float = 0.0) -> float:
        """The number after `letter`; 0 where the letter stands alone, `default` where it is missing."""
        found = self.words.get(letter, default)
        return 0.0 if found is None else found

    def number(self, letter: str) -> float | None:
        """The number after `letter`, or None."""
        return self.words.get(letter)


def bare(line: bytes) -> str:
    """A queued line without its number and checksum."""
    text = line.decode("latin-1")
    found = NUMBERED.match(text)
    if found:
        text = text[found.end() :]
        star = text.rfind("*")
        if star >= 0:
            text = text[:star]
    else:
        text = text.lstrip(" ")
        star = text.rfind("*")
        if star >= 0:
            text = text[:star]
    return text.rstrip(" ")


def parse(text: str) -> Command | None:
    """The command in a bare line; None where it does not begin with G, M or T and a number."""
    head = HEAD.match(text)
    if head is None:
        return None
    code = f"{head[1]}{int(head[2])}" + (f".{head[3]}" if head[3] else "")
    rest = text[head.end() :]
    words = {letter: float(number) if number else None for letter, number in WORD.findall(rest)}
    return Command(code, words, rest.lstrip(" "))
