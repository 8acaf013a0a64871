#!/usr/bin/env python3
"""Which gates of the diagnosis decide anything.

    python3 tests/exam/gates.py DIR...

DIR is a folder of `flexspline-exam run`. A judgement of a law comes to several gates; a gate decides alone where it is
the only one that does not let the law through. What never does could go without a change of any answer.
"""

import collections
import json
import pathlib
import sys


def judgements(trace):
    """Lists of the gates that one law came to at once: `trace` has them one after the other."""
    found, before = [], None
    for entry in trace:
        place = [entry.get(key) for key in ("cause", "stage", "round", "against")]
        if place != before or any(gate["gate"] == entry["gate"] for gate in found):
            yield found
            found = []
        found.append(entry)
        before = place
    yield found


def main():
    judged, stopped, alone, cases = (collections.Counter() for _ in range(4))
    answers = [path for folder in sys.argv[1:] for path in sorted(pathlib.Path(folder).glob("answers/*/diagnosis.json"))]
    if not answers:
        sys.exit(f"no answers in {sys.argv[1:]}; allowed: folders of `flexspline-exam run --out`")
    for path in answers:
        decided = set()
        for gates in judgements(json.loads(path.read_text())["trace"]):
            judged.update(gate["gate"] for gate in gates)
            bad = [gate["gate"] for gate in gates if not gate["passed"]]
            stopped.update(bad)
            if len(bad) == 1:
                alone.update(bad)
                decided.update(bad)
        cases.update(decided)
    print(f"{len(answers)} cases\n\n| gate | judged | stopped | alone | in cases |\n|---|---|---|---|---|")
    for gate in sorted(judged, key=lambda gate: (alone[gate], judged[gate])):
        print(f"| {gate} | {judged[gate]} | {stopped[gate]} | {alone[gate]} | {cases[gate]} |")


if __name__ == "__main__":
    main()
