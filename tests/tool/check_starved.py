#!/usr/bin/python3
"""check_starved.py TEXKIT LIBRARY TRIES ARGUMENT... - a run of texkit whose allocations fail, each in turn

LIBRARY is tests/kit/starve.c, compiled. The run succeeds if no allocation fails. If one does, it must end
with status 1, one line on stderr and no output; or succeed with the same output as before, where it can
do without. At most TRIES allocations are tried: half of these are the first ones, the others are spread evenly
over the rest, to the last.
Outputs are what is new in the current folder."""
import os
import shutil
import subprocess
import sys

texkit, library, tries, arguments = sys.argv[1], sys.argv[2], int(sys.argv[3]), sys.argv[4:]
there = set(os.listdir("."))


def run(at):
    environment = dict(os.environ, LD_PRELOAD=library, STARVE_AT=str(at), STARVE_COUNT="../count")
    done = subprocess.run([texkit] + arguments + ["--threads", "1", "--quiet"], env=environment,
                          stdin=subprocess.DEVNULL, capture_output=True)
    return done.returncode, done.stderr.decode()


def take_outputs():
    """The bytes of all files that are new, by path; they are removed."""
    taken = {}
    for name in set(os.listdir(".")) - there:
        for folder, _, files in os.walk(name) if os.path.isdir(name) else [("", [], [name])]:
            for file in files:
                with open(os.path.join(folder, file), "rb") as opened:
                    taken[os.path.join(folder, file)] = opened.read()
        if os.path.isdir(name):
            shutil.rmtree(name)
        else:
            os.remove(name)
    return taken


status, errors = run(0)
want = take_outputs()
if status or not want:
    sys.exit("status %d, %d files: %s" % (status, len(want), errors))
with open("../count") as file:
    count = int(file.read())
first = min(count, tries // 2)
others = min(count - first, tries - first)
chosen = list(range(1, first + 1)) + [first + (count - first) * (k + 1) // others for k in range(others)]
wrong = 0
for at in chosen:
    status, errors = run(at)
    made = take_outputs()
    refused = status == 1 and not made and errors.startswith("texkit") and errors.count("\n") == 1
    if not refused and not (status == 0 and made == want):
        print("allocation", at, "of", count, "fails: status", status, "files", sorted(made), errors)
        wrong += 1
print(len(chosen), "of", count, "allocations")
if wrong or len(chosen) < min(count, 10):
    sys.exit(1)
