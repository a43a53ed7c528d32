#!/usr/bin/env python3
# read_model.py - a reader of .txs models written from model-format.md: read_model.py MODEL.txs...
# SPDX-License-Identifier: MIT OR Unlicense
"""Prints the neighbourhood system of texsyn.h models. With --bins also the histograms and the
potentials. Meant to be read beside model-format.md; it shares no code with the library."""
import struct
import sys
import zlib

KINDS = ["single", "pair", "parent", "values", "corner", "scale", "parallel",
         "filter", "context"]
SINGLE, PAIR, PARENT, VALUES, CORNER, SCALE, PARALLEL, FILTER, CONTEXT = range(9)
NONE, REVERSED, DIAGONAL = range(3)
SHAPES = [(0, 1, 1, 0), (1, 0, 0, 1), (1, -1, 1, 1), (1, 1, -1, 1),
          (0, 1, 1, 0), (1, 0, 0, 1), (0, 1, 1, 0), (1, 0, 0, 1)]  # d and e of the filters
ROOT_SCALES = [48, 36, 26]  # on levels 0, 1, and 2 or more; of all kinds but SINGLE
ROOT_SCALE_SINGLE = 160
RARE = 3  # the smallest root that has a potential


class BadModel(Exception):
    pass


def require(condition, what):
    if not condition:
        raise BadModel(what)


def quotient(a, b):
    """a / b, truncated towards zero as in C"""
    return abs(a) // b * (1 if a >= 0 else -1)


class Chance:
    def __init__(self):
        self.zero, self.seen = 32768, 0


class Context:
    def __init__(self):
        self.zero, self.sign = Chance(), Chance()
        self.more = [Chance() for _ in range(14)]


class Coder:
    """Bits and numbers."""

    def __init__(self, body):
        self.body, self.at = body, 0
        self.range, self.code = 0xFFFFFFFF, 0
        for _ in range(5):
            self.shift_in()

    def shift_in(self):
        require(self.at < len(self.body), "too short")
        self.code = (self.code << 8 | self.body[self.at]) & 0xFFFFFFFF
        self.at += 1

    def bit(self, chance):
        bound = self.range * chance.zero >> 16
        bit = self.code >= bound
        if bit:
            self.code -= bound
            self.range -= bound
        else:
            self.range = bound
        target = 512 if bit else 65024
        chance.zero += quotient((target - chance.zero) * 2, 2 * chance.seen + 3)
        chance.seen = min(chance.seen + 1, 24)
        while self.range < 1 << 24:
            self.range <<= 8
            self.shift_in()
        return int(bit)

    def raw(self, count):
        value = 0
        for _ in range(count):
            value = value << 1 | self.bit(Chance())
        return value

    def limited(self, bits, low, high):
        value = low + self.raw(bits)
        require(value <= high, "a number out of its limits")
        return value

    def real(self):
        value = struct.unpack(">f", struct.pack(">I", self.raw(24) << 8))[0]
        require(abs(value) < float("inf"), "a number that is not finite")
        return value

    def number(self, context):
        if not self.bit(context.zero):
            return 0
        negative, n = self.bit(context.sign), 1
        while n <= 14 and self.bit(context.more[n - 1]):
            n += 1
        if n > 14:
            n += self.raw(12)
        return -n if negative else n

    def sequence(self, contexts, like, count, low, high, mirror):
        v, surprise, drift = [], 0, 0
        for i in range(count):
            twin = [i, count - 1 - i, i % 9 * 9 + i // 9][mirror]
            expected = like[i] + quotient(drift * 3, 4) if like else drift
            if twin < i:
                expected = quotient(expected + 3 * v[twin] + 2, 4)
            expected = min(max(expected, low), high)
            context = contexts[min(abs(surprise), 3) + (4 if expected == low else 0)]
            surprise = self.number(context)
            require(low <= expected + surprise <= high, "a statistic out of its limits")
            v.append(expected + surprise)
            drift = v[i] - (like[i] if like else 0)
        return v


class Type:
    def __init__(self, kind, band, other):
        self.kind, self.band, self.other = kind, band, other
        self.dx = self.dy = self.ex = self.ey = self.phase = 0
        self.shape = self.scale = 0

    def members(self):
        d, e = (self.dx, self.dy), (self.ex, self.ey)
        at = [(0, 0)]
        if self.kind not in (SINGLE, PARENT):
            at.append(d)
        if self.kind >= CORNER:
            at.append(e)
        if self.kind == SCALE:
            at.append((d[0] - e[0], d[1] - e[1]))
        if self.kind == PARALLEL:
            at.append((d[0] + e[0], d[1] + e[1]))
        if self.kind == CONTEXT:
            at += [(e[0] + x, e[1] + y) for x in (-2, 2) for y in (-2, 2)]
        return at


def read_description(coder, place, bands, is_coarsest, version):
    kind = coder.limited(3, PAIR, PARALLEL if version == 1 else CONTEXT)
    t = Type(kind, coder.limited(2, 0, bands - 1), 0)
    if kind == PAIR:
        t.phase = coder.limited(2, 0, 2)
    if kind == FILTER:
        t.other, t.shape, t.scale = t.band, coder.limited(4, 0, 7), coder.limited(9, 1, 279)
        t.dx, t.dy, t.ex, t.ey = SHAPES[t.shape]
        return t
    t.other = t.band if kind in (CORNER, CONTEXT) else coder.limited(2, 0, bands - 1)
    if kind != PARENT:
        t.dx, t.dy = coder.number(place[0][kind]), coder.number(place[1][kind])
    if kind >= CORNER:
        t.ex, t.ey = coder.number(place[2][kind]), coder.number(place[3][kind])
    require(not (is_coarsest and kind in (PARENT, SCALE, CONTEXT)), "nothing is coarser")
    d, e, same = (t.dx, t.dy), (t.ex, t.ey), t.band == t.other
    if kind in (CORNER, SCALE, PARALLEL) or (kind in (PAIR, VALUES) and same):
        require(d != (0, 0), "members coincide")
    if kind == CORNER or (kind == PARALLEL and same):
        require(e != (0, 0) and e != d, "members coincide")
    if kind == PARALLEL and same:
        require(e != (-t.dx, -t.dy), "members coincide")
    at = t.members()
    reach = max(abs(p[k] - q[k]) for p in at for q in at for k in (0, 1))
    require(max(map(abs, d + e)) <= 60 and reach <= 60, "a clique too long")
    return t


def most_alike(t, earlier):
    best, least = None, 0
    for o in earlier:
        far = 200 * (o.band != t.band) + 100 * (o.other != t.other)
        far += 8 * abs(abs(t.dx) + abs(t.dy) - abs(o.dx) - abs(o.dy))
        far += abs(o.dx - t.dx) + abs(o.dy - t.dy)
        if o.kind == t.kind and (best is None or far <= least):
            best, least = o, far
    return best


def read_statistics(coder, contexts_of, t, earlier, level, values):
    share, potential = contexts_of
    bins = values if t.kind == SINGLE else 63 if t.kind in (PAIR, PARENT) else 81
    bins = 27 if t.kind == FILTER else bins
    scale = ROOT_SCALE_SINGLE if t.kind == SINGLE else ROOT_SCALES[min(level, 2)]
    like, same = most_alike(t, earlier), t.band == t.other
    mirror = NONE
    if same and t.kind == VALUES:
        mirror = DIAGONAL
    elif same and t.kind not in (SINGLE, CORNER, CONTEXT):
        mirror = REVERSED
    root = coder.sequence(share[t.kind], like and like.root, bins, 0, scale, mirror)
    used = sum(r >= RARE for r in root)
    mirror = REVERSED if same and t.kind != SINGLE else NONE
    steps = iter(coder.sequence(potential[t.kind], None, used, -20, 20, mirror))
    root += [0] * ((32 if t.kind == SINGLE else bins) - bins)
    total = sum(r * r for r in root)
    require(total > 0, "an empty histogram")
    t.root = root
    t.share = [r * r * 65536 // total for r in root]
    t.potential = [(next(steps) if r >= RARE else 1) / 2 for r in root]  # nats


class Model:
    def __init__(self, data):
        require(data[:4] in (b"TXS1", b"TXS2"), "not a texsyn model")
        version = data[3] - ord("0")
        require(8 <= len(data) <= (1 << 20) + 4, "of a wrong size")
        require(zlib.crc32(data[:-4]) == struct.unpack("<I", data[-4:])[0], "damaged or too short")
        coder = Coder(data[4:-4])
        self.channels = [1, 3, 4][coder.limited(2, 0, 2)]
        self.bands = coder.limited(2, 1, self.channels)
        self.levels = coder.limited(3, 1, 6)
        self.mean = [coder.real() for _ in range(self.channels)]
        self.basis, self.dither = [], []
        for _ in range(self.bands):
            self.basis.append([coder.limited(16, -16384, 16384) / 16384 for _ in self.mean])
            self.dither.append(coder.limited(8, 0, 255) / 255)
        place = [[Context() for _ in KINDS] for _ in range(4)]
        contexts = [[[Context() for _ in range(8)] for _ in KINDS] for _ in range(2)]
        self.types = [None] * self.levels
        self.labels = [None] * self.levels  # limits of gradient and curve, two of each
        self.values = [None] * self.levels  # (number, low, step) of each band
        for level in reversed(range(self.levels)):
            values = self.values[level] = []
            for _ in range(self.bands):
                values.append((coder.limited(5, 1, 32), coder.real(), coder.real()))
                require(values[-1][2] > 0, "a step of no size")
            if version > 1 and level + 1 < self.levels:
                self.labels[level] = [(coder.limited(15, 0, 30752), coder.limited(9, -128, 128))
                                      for _ in range(2)]
            count = coder.limited(7, self.bands, 96)
            types = self.types[level] = []
            for k in range(count):
                if k < self.bands:
                    t = Type(SINGLE, k, k)
                else:
                    t = read_description(coder, place, self.bands, level + 1 == self.levels,
                                         version)
                read_statistics(coder, contexts, t, types, level, values[t.band][0])
                types.append(t)
        require(coder.at == len(coder.body), "bytes left over")


def main(arguments):
    show_bins = "--bins" in arguments
    for path in (a for a in arguments if a != "--bins"):
        try:
            with open(path, "rb") as file:
                model = Model(file.read())
        except (OSError, BadModel) as error:
            sys.exit(f"read_model: '{path}': {error}")
        print(f"{model.channels} channels, {model.bands} bands, {model.levels} levels")
        print("mean " + " ".join(f"{m:.6g}" for m in model.mean))
        for b, basis in enumerate(model.basis):
            print(f"band {b}: " + " ".join(f"{x:+.4f}" for x in basis)
                  + f", dither {model.dither[b]:.3f}")
        for level in range(model.levels):
            for b, (count, low, step) in enumerate(model.values[level]):
                print(f"level {level} band {b}: {count} values from {low:.6g} by {step:.6g}")
            for t in model.types[level]:
                print(f"{level} {KINDS[t.kind]} {t.band} {t.other} {t.dx} {t.dy} {t.ex} {t.ey}"
                      + ["", " even", " odd"][t.phase])
                if show_bins:
                    print("  share " + " ".join(map(str, t.share)))
                    print("  potential " + " ".join(f"{p:g}" for p in t.potential))


if __name__ == "__main__":
    main(sys.argv[1:])
