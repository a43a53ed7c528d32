// oiio_compare.cpp - compare pictures by what they have in common, through OpenImageIO
// SPDX-License-Identifier: MIT OR Unlicense
//
//   oiio_compare same    A B         [LIMIT...]   the same picture, pixel by pixel
//   oiio_compare texture EXEMPLAR B  [LIMIT...]   the same kind of texture
//   oiio_compare wrap    A...        [LIMIT...]   do they continue across their borders
//   oiio_compare seam    A SIZE      [LIMIT...]   does a picture of square tiles hide its joints
//   oiio_compare shuffle A OUT [SIDE]             write A's pixels, or squares of it, in random order
//   oiio_compare deep    OUT CHANNELS             write a picture of 16 bits, noise and slopes
//
// Prints one "figure value" per line. A limit is written mean<0.1 or psnr>30; the exit status is 1
// if a figure is beyond its limit, 2 if a picture cannot be read.
//
// same:    mean, rms and max difference (0..1), psnr (dB).
// texture: each figure is a distance between statistics of the two pictures over the same distance
//          between the left and the right half of the exemplar: 1 = as alike as the exemplar's own
//          halves. histogram: values per channel; gradient: differences of neighbours; reach:
//          differences of pixels 2 to 16 apart; each the largest over channels and displacements of
//          the earth mover's distance. autocorrelation: rms over displacements up to 12 pixels.
//          mean: the largest difference of a channel's mean, in levels of 0..255, not a ratio.
//          novelty: the distance of blocks of B to their nearest blocks in the exemplar, over the
//          same for blocks of the exemplar to their nearest blocks elsewhere in it; 0 = copied.
// wrap:    x and y: the mean difference across the border over the mean difference inside, over
//          all pictures together.
// seam:    x and y: the mean difference across the joints of tiles of SIZE pixels over the mean
//          difference inside the tiles; beside: the same for the places 2 to 4 pixels beside the
//          joints, where cuts begin, both axes together. 1 = like any other place.
#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <random>
#include <string>
#include <vector>

namespace {

struct Picture {
    int width = 0, height = 0, channels = 0;
    std::vector<float> samples; // 0..255

    float at(int x, int y, int c) const {
        return samples[(size_t(y) * size_t(width) + size_t(x)) * size_t(channels) + size_t(c)];
    }

    float luma(int x, int y) const {
        if (channels < 3) return at(x, y, 0);
        return 0.299f * at(x, y, 0) + 0.587f * at(x, y, 1) + 0.114f * at(x, y, 2);
    }

    Picture columns(int first, int count) const {
        Picture part;
        part.width = count;
        part.height = height;
        part.channels = channels;
        for (int y = 0; y < height; y++) {
            for (int x = first; x < first + count; x++) {
                for (int c = 0; c < channels; c++) part.samples.push_back(at(x, y, c));
            }
        }
        return part;
    }
};

[[noreturn]] void give_up(const std::string &message) {
    std::fprintf(stderr, "oiio_compare: %s\n", message.c_str());
    std::exit(2);
}

Picture load(const std::string &path) {
    OIIO::ImageBuf buffer(path);
    if (!buffer.read(0, 0, true, OIIO::TypeDesc::FLOAT)) give_up(path + ": " + buffer.geterror());
    Picture p;
    p.width = buffer.spec().width;
    p.height = buffer.spec().height;
    p.channels = buffer.spec().nchannels;
    p.samples.resize(size_t(p.width) * size_t(p.height) * size_t(p.channels));
    buffer.get_pixels(buffer.roi(), OIIO::TypeDesc::FLOAT, p.samples.data());
    for (float &s : p.samples) s *= 255.0f;
    return p;
}

// ---- statistics

using Histogram = std::vector<double>; // over 0..255 or -255..255, sums to 1

void normalise(Histogram &h) {
    double sum = 0;
    for (double v : h) sum += v;
    for (double &v : h) v /= std::max(sum, 1.0);
}

Histogram values(const Picture &p, int c) {
    Histogram h(256, 0.0);
    for (int y = 0; y < p.height; y++) {
        for (int x = 0; x < p.width; x++) h[size_t(std::lround(p.at(x, y, c)))] += 1;
    }
    normalise(h);
    return h;
}

Histogram differences(const Picture &p, int c, int dx, int dy) {
    Histogram h(511, 0.0);
    for (int y = 0; y + dy < p.height; y++) {
        for (int x = std::max(0, -dx); x < p.width - std::max(0, dx); x++)
            h[size_t(std::lround(p.at(x + dx, y + dy, c)) - std::lround(p.at(x, y, c)) + 255)] += 1;
    }
    normalise(h);
    return h;
}

// The earth mover's distance, in levels.
double distance(const Histogram &a, const Histogram &b) {
    double carried = 0, work = 0;
    for (size_t i = 0; i < a.size(); i++) {
        carried += a[i] - b[i];
        work += std::fabs(carried);
    }
    return work;
}

double mean(const Picture &p, int c) {
    double sum = 0;
    for (size_t i = size_t(c); i < p.samples.size(); i += size_t(p.channels)) sum += p.samples[i];
    return sum / (double(p.width) * double(p.height));
}

// Normalised autocorrelation of the luma for all displacements up to reach pixels.
std::vector<double> autocorrelation(const Picture &p, int reach) {
    double average = 0, variance = 0;
    const double count = double(p.width) * double(p.height);
    for (int y = 0; y < p.height; y++) {
        for (int x = 0; x < p.width; x++) average += double(p.luma(x, y)) / count;
    }
    std::vector<double> centred;
    for (int y = 0; y < p.height; y++) {
        for (int x = 0; x < p.width; x++) {
            centred.push_back(double(p.luma(x, y)) - average);
            variance += centred.back() * centred.back() / count;
        }
    }
    std::vector<double> result;
    for (int dy = 0; dy <= reach; dy++) {
        for (int dx = dy ? -reach : 1; dx <= reach; dx++) {
            double sum = 0, n = 0;
            for (int y = 0; y + dy < p.height; y++) {
                for (int x = std::max(0, -dx); x < p.width - std::max(0, dx); x++, n++)
                    sum += centred[size_t(y) * size_t(p.width) + size_t(x)] *
                           centred[size_t(y + dy) * size_t(p.width) + size_t(x + dx)];
            }
            result.push_back(sum / std::max(n * variance, 1e-9));
        }
    }
    return result;
}

struct Distances {
    double histogram = 0, gradient = 0, reach = 0, autocorrelation = 0, mean = 0;
};

Distances compare(const Picture &a, const Picture &b) {
    static const int near_by[4][2] = {{1, 0}, {0, 1}, {1, 1}, {-1, 1}};
    static const int far_off[8][2] = {{2, 0},  {0, 2},  {4, 3},  {-3, 4},
                                      {8, 0},  {0, 8}, {12, 9}, {-9, 12}};
    Distances d;
    for (int c = 0; c < a.channels; c++) {
        d.mean = std::max(d.mean, std::fabs(mean(a, c) - mean(b, c)));
        d.histogram = std::max(d.histogram, distance(values(a, c), values(b, c)));
        for (const auto &v : near_by)
            d.gradient = std::max(d.gradient, distance(differences(a, c, v[0], v[1]),
                                                       differences(b, c, v[0], v[1])));
        for (const auto &v : far_off)
            d.reach = std::max(d.reach, distance(differences(a, c, v[0], v[1]),
                                                 differences(b, c, v[0], v[1])));
    }
    const std::vector<double> f = autocorrelation(a, 12), g = autocorrelation(b, 12);
    for (size_t i = 0; i < f.size(); i++) d.autocorrelation += (f[i] - g[i]) * (f[i] - g[i]);
    d.autocorrelation = std::sqrt(d.autocorrelation / double(f.size()));
    return d;
}

// The mean over some blocks of p of the distance to the nearest block in q. Where the two are one
// picture, blocks that overlap the block itself do not count.
double nearest_blocks(const Picture &p, const Picture &q, bool same_picture) {
    const int side = 12, per_axis = 6;
    double total = 0;
    for (int k = 0; k < per_axis * per_axis; k++) {
        const int px = (p.width - side) * (k % per_axis) / (per_axis - 1);
        const int py = (p.height - side) * (k / per_axis) / (per_axis - 1);
        float best = 1e30f;
        for (int qy = 0; qy + side <= q.height; qy++) {
            for (int qx = 0; qx + side <= q.width; qx++) {
                if (same_picture && std::abs(qx - px) < side && std::abs(qy - py) < side) continue;
                float sum = 0;
                for (int y = 0; y < side && sum < best; y++) {
                    for (int x = 0; x < side; x++) {
                        for (int c = 0; c < p.channels; c++)
                            sum += std::fabs(p.at(px + x, py + y, c) - q.at(qx + x, qy + y, c));
                    }
                }
                best = std::min(best, sum);
            }
        }
        total += double(best);
    }
    return total;
}

// ---- commands

using Figures = std::map<std::string, double>;

Figures same(const std::string &a, const std::string &b) {
    OIIO::ImageBuf p(a), q(b);
    if (!p.read() || !q.read()) give_up("cannot read " + a + " or " + b);
    if (p.spec().width != q.spec().width || p.spec().height != q.spec().height ||
        p.spec().nchannels != q.spec().nchannels)
        give_up("the pictures differ in size or channels");
    const auto result = OIIO::ImageBufAlgo::compare(p, q, 1.0f, 1.0f);
    return {{"mean", result.meanerror},
            {"rms", result.rms_error},
            {"max", result.maxerror},
            {"psnr", std::min(result.PSNR, 999.0)}};
}

Figures texture(const Picture &exemplar, const Picture &b) {
    if (exemplar.channels != b.channels) give_up("the pictures differ in channels");
    const int half = exemplar.width / 2;
    const Distances d = compare(exemplar, b);
    const Distances own = compare(exemplar.columns(0, half), exemplar.columns(half, half));
    return {{"mean", d.mean},
            {"histogram", d.histogram / std::max(own.histogram, 1.0)},
            {"gradient", d.gradient / std::max(own.gradient, 1.0)},
            {"reach", d.reach / std::max(own.reach, 1.0)},
            {"autocorrelation", d.autocorrelation / std::max(own.autocorrelation, 0.01)},
            {"novelty", nearest_blocks(b, exemplar, false) /
                            std::max(nearest_blocks(exemplar, exemplar, true), 1.0)}};
}

Figures wrap(const std::vector<std::string> &paths) {
    double border[2] = {0, 0}, inside[2] = {0, 0};
    for (const std::string &path : paths) {
        const Picture p = load(path);
        for (int y = 0; y < p.height; y++) {
            for (int x = 0; x < p.width; x++) {
                for (int c = 0; c < p.channels; c++) {
                    const double dx = double(p.at((x + 1) % p.width, y, c) - p.at(x, y, c));
                    const double dy = double(p.at(x, (y + 1) % p.height, c) - p.at(x, y, c));
                    (x + 1 == p.width ? border : inside)[0] +=
                        std::fabs(dx) / (x + 1 == p.width ? 1 : p.width - 1);
                    (y + 1 == p.height ? border : inside)[1] +=
                        std::fabs(dy) / (y + 1 == p.height ? 1 : p.height - 1);
                }
            }
        }
    }
    return {{"x", border[0] / std::max(inside[0], 1e-9)},
            {"y", border[1] / std::max(inside[1], 1e-9)}};
}

Figures seam(const Picture &p, int size) {
    if (size < 8 || p.width < 2 * size || p.height < 2 * size) give_up("seam: fewer than 2 x 2 tiles");
    Figures figures{{"beside", 0}};
    for (int axis = 0; axis < 2; axis++) {
        const int dx = axis == 0, dy = axis == 1;
        std::vector<double> sum(size_t(size), 0.0), count(size_t(size), 0.0); // by place in the tile
        for (int y = 0; y + dy < p.height; y++) {
            for (int x = 0; x + dx < p.width; x++) {
                const size_t place = size_t((axis ? y : x) % size);
                for (int c = 0; c < p.channels; c++)
                    sum[place] += std::fabs(double(p.at(x + dx, y + dy, c) - p.at(x, y, c)));
                count[place] += p.channels;
            }
        }
        double inside = 0, pixels = 0;
        for (size_t i = 0; i + 1 < sum.size(); i++) {
            inside += sum[i];
            pixels += count[i];
        }
        const auto ratio = [&](int i) {
            return sum[size_t(i)] / count[size_t(i)] / std::max(inside / pixels, 1e-9);
        };
        figures[axis ? "y" : "x"] = ratio(size - 1);
        for (const int i : {1, 2, 3, size - 5, size - 4, size - 3})
            figures["beside"] += ratio(i) / 12;
    }
    return figures;
}

// What does not fill a square at the right and lower border is left out.
void shuffle(const std::string &from, const std::string &to, int side) {
    const Picture p = load(from);
    const int columns = p.width / side, rows = p.height / side, channels = p.channels;
    const size_t count = size_t(columns) * size_t(rows);
    if (side < 1 || count == 0) give_up("shuffle: larger squares than the picture");
    OIIO::ImageSpec spec(columns * side, rows * side, channels, OIIO::TypeDesc::UINT8);
    std::vector<unsigned char> out(count * size_t(side) * size_t(side) * size_t(channels));
    std::vector<size_t> order(count);
    std::mt19937 random(1);
    for (size_t i = 0; i < count; i++) {
        const size_t j = random() % (i + 1);
        order[i] = order[j];
        order[j] = i;
    }
    size_t to_sample = 0;
    for (int y = 0; y < spec.height; y++) {
        for (int x = 0; x < spec.width; x++) {
            const int block = int(order[size_t(y / side * columns + x / side)]);
            for (int c = 0; c < channels; c++)
                out[to_sample++] = static_cast<unsigned char>(
                    std::lround(p.at(block % columns * side + x % side,
                                     block / columns * side + y % side, c)));
        }
    }
    OIIO::ImageBuf buffer(spec, out.data());
    if (!buffer.write(to)) give_up("cannot write " + to);
}

// OpenImageIO itself writes PNM of 8 bits only (and reads those of 16 off by one here and there).
void deep(const std::string &to, int channels) {
    if (channels < 1 || channels > 4) give_up("deep: 1 to 4 channels");
    OIIO::ImageSpec spec(150, 90, channels, OIIO::TypeDesc::UINT16);
    spec.attribute("oiio:UnassociatedAlpha", 1); // as PNG has it: write the numbers as they are
    std::vector<std::uint16_t> samples;
    std::mt19937 random(1);
    for (int i = 0; i < spec.width * spec.height * channels; i++) {
        const int x = i / channels % spec.width, noise = int(random() & 0xffff);
        samples.push_back(std::uint16_t(i % channels % 2 ? 437 * x + noise % 4 : noise));
    }
    if (to.back() == 'm') {
        std::FILE *file = std::fopen(to.c_str(), "wb");
        if (!file) give_up("cannot write " + to);
        std::fprintf(file, "P%d %d %d 65535\n", channels == 1 ? 5 : 6, spec.width, spec.height);
        for (const int s : samples) {
            std::fputc(s >> 8, file);
            std::fputc(s & 255, file);
        }
        std::fclose(file);
        return;
    }
    OIIO::ImageBuf buffer(spec, samples.data());
    if (!buffer.write(to)) give_up("cannot write " + to);
}

} // namespace

int main(int argc, char **argv) {
    const std::string command = argc > 1 ? argv[1] : "";
    std::vector<std::string> paths;
    for (int i = 2; i < argc && !std::strpbrk(argv[i], "<>"); i++) paths.emplace_back(argv[i]);
    const int files = int(paths.size());
    if (command == "wrap" ? files < 1 : files != 2 && !(command == "shuffle" && files == 3))
        give_up("usage: same A B | texture EXEMPLAR B | wrap A... | seam A SIZE, [FIGURE<LIMIT...] | "
                "shuffle A OUT [SIDE] | deep OUT CHANNELS");

    Figures figures;
    if (command == "same") figures = same(argv[2], argv[3]);
    else if (command == "texture") figures = texture(load(argv[2]), load(argv[3]));
    else if (command == "wrap") figures = wrap(paths);
    else if (command == "seam") figures = seam(load(paths[0]), std::atoi(argv[3]));
    else if (command == "shuffle")
        shuffle(paths[0], paths[1], files == 3 ? std::atoi(argv[4]) : 1);
    else if (command == "deep") deep(paths[0], std::atoi(argv[3]));
    else give_up("unknown command " + command);
    for (const auto &f : figures) std::printf("%s %.4g\n", f.first.c_str(), f.second);

    int status = 0;
    for (int i = 2 + files; i < argc; i++) {
        const char *sign = std::strpbrk(argv[i], "<>");
        const std::string name(argv[i], sign ? size_t(sign - argv[i]) : 0);
        if (!sign || !figures.count(name)) give_up(std::string("bad limit ") + argv[i]);
        const double limit = std::atof(sign + 1), value = figures[name];
        if (*sign == '<' ? value < limit : value > limit) continue;
        std::printf("%s is %.4g, not %c %.4g\n", name.c_str(), value, *sign, limit);
        status = 1;
    }
    return status;
}
