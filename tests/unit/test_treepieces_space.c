/* test_treepieces_space.c - trees: branches keep apart, and trees of fewer pieces
   SPDX-License-Identifier: MIT OR Unlicense                                                    */
#include "treepieces.h"

#include "growkit.h"

/* ---- branches keep apart ------------------------------------------------------------------ */

/* The axis of a piece, a cone with round ends. */
typedef struct cone {
    double from[3], along[3]; /* along: to its end */
    double radius, end;
} cone;

static cone *make_cones(const treepieces_forest *f) {
    float *bones = make_bones(f, NULL);
    cone *c = (cone *)room(f->node_count, sizeof *c);
    for (uint32_t i = 0; i < f->node_count; i++) {
        const treepieces_node *n = &f->nodes[i];
        for (int k = 0; k < 3; k++) {
            c[i].from[k] = (double)bones[TREEPIECES_BONE * i + 4 * (uint32_t)k + 3];
            c[i].along[k] = (double)bones[TREEPIECES_BONE * i + 4 * (uint32_t)k + 1];
        }
        c[i].radius = (double)n->radius;
        c[i].end = n->type == TREEPIECES_TIP ? 0 : c[i].radius;
        if (n->parent >= 0 && n->joint >> 3 == 0) c[n->parent].end = c[i].radius;
    }
    free(bones);
    return c;
}

static double distance_at(const cone *a, double s, const cone *b, double t) {
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        const double d = a->from[k] + s * a->along[k] - b->from[k] - t * b->along[k];
        sum += d * d;
    }
    return sqrt(sum);
}

/* The place on a nearest to a given place on b, 0..1. */
static double project(const cone *a, const cone *b, double t) {
    double up = 0, down = 1e-30;
    for (int k = 0; k < 3; k++) {
        up += a->along[k] * (b->from[k] + t * b->along[k] - a->from[k]);
        down += a->along[k] * a->along[k];
    }
    return up <= 0 ? 0 : up >= down ? 1 : up / down;
}

/* Do two cones overlap by a tenth of their radii, other than within some radii of the piece from which
   both come? Axes are searched by projecting to and fro, which ends at the nearest places. */
static int cross(const treepieces_forest *f, const cone *cones, int i, int j) {
    const cone *a = &cones[i], *b = &cones[j];
    double s = 0.5, t = 0.5;
    for (int k = 0; k < 3; k++)
        if (fabs(a->from[k] + a->along[k] / 2 - b->from[k] - b->along[k] / 2) >
            fabs(a->along[k] / 2) + fabs(b->along[k] / 2) + a->radius + b->radius)
            return 0;
    for (int step = 0; step < 60; step++) {
        s = project(a, b, t);
        t = project(b, a, s);
    }
    const double radii = a->radius + s * (a->end - a->radius) + b->radius + t * (b->end - b->radius);
    if (distance_at(a, s, b, t) >= 0.9 * radii) return 0;
    int joints = 0;
    while (i != j) {
        if (i > j) i = f->nodes[i].parent;
        else j = f->nodes[j].parent;
        joints++;
    }
    const cone *fork = &cones[i];
    cone place = *a;
    for (int k = 0; k < 3; k++) {
        place.from[k] += s * a->along[k];
        place.along[k] = 0;
    }
    return joints > 2 && distance_at(&place, 0, fork, project(fork, &place, 0)) > 2.5 * fork->radius;
}

static int count_crossings(const treepieces_forest *f) {
    cone *cones = make_cones(f);
    int count = 0;
    assert_int_equal(f->tree_count, 1);
    for (int i = 0; i < (int)f->node_count; i++)
        for (int j = i + 1; j < (int)f->node_count; j++) count += cross(f, cones, i, j);
    free(cones);
    return count;
}

/* In 19 of 20 trees no branch passes through another one, and without a clearance many do. */
static void test_branches_keep_apart(void **state) {
    (void)state;
    const int seeds = tk_full() ? 25 : 3;
    int trees = 0, clean = 0, clean_before = 0;
    for (int i = 0; i < treepieces_preset_count(); i++) {
        treepieces_species s;
        const char *text = treepieces_preset_text(i);
        assert_int_equal(treepieces_species_parse(text, strlen(text), NULL, &s), TXM_OK);
        assert_true(s.clearance > 0);
        const float clearance = s.clearance;
        for (int seed = 0; seed < seeds; seed++, trees++) {
            treepieces_forest_desc d = describe(1, 600);
            d.species = &s;
            d.seed = 100 + (uint64_t)seed;
            for (int apart = 0; apart < 2; apart++) {
                s.clearance = apart ? clearance : 0;
                treepieces_forest *f = grow(&d);
                const int is_clean = count_crossings(f) == 0;
                *(apart ? &clean : &clean_before) += is_clean;
                treepieces_forest_free(f);
            }
        }
    }
    printf("no branches cross in %d of %d trees, without clearance in %d\n", clean, trees, clean_before);
    assert_true(20 * clean >= 19 * trees);
    assert_true(2 * clean_before < 1.2 * trees);
}

/* ---- fewer pieces --------------------------------------------------------------------------- */

/* The height of the highest place, and how far the tree reaches along x and z on average. */
static void measure(const treepieces_forest *f, const cone *cones, double *height, double *width) {
    double low[3] = {0, 0, 0}, high[3] = {0, 0, 0};
    for (uint32_t i = 0; i < f->node_count; i++)
        for (int k = 0; k < 3; k++) {
            const double end = cones[i].from[k] + cones[i].along[k];
            low[k] = fmin(low[k], end);
            high[k] = fmax(high[k], end);
        }
    *height = high[1];
    *width = 0.5 * (high[0] - low[0] + high[2] - low[2]);
}

/* The share of a small tree's joints that lie near a stem of the large one. */
static double share_near(const treepieces_forest *f, const cone *cones, const treepieces_forest *large,
                         const cone *others, double near_by) {
    size_t found = 0;
    for (uint32_t i = 0; i < f->node_count; i++) {
        int is_near = 0;
        for (uint32_t j = 0; j < large->node_count && !is_near; j++)
            is_near = distance_at(&cones[i], 0, &others[j], project(&others[j], &cones[i], 0)) < near_by;
        found += (size_t)is_near;
    }
    return (double)found / f->node_count;
}

/* Trees of the same seed and fewer pieces have the same height and the same branches, as far as they have
   them. */
static void test_one_skeleton(void **state) {
    (void)state;
    static const int limits[] = {60, 120, 300, 600};
    enum { LIMITS = sizeof limits / sizeof *limits };
    const int seeds = tk_full() ? 10 : 2;
    double wide = 0, narrow = 0, apart = 0, worst = 0;
    int too_high = 0, trees = 0;
    for (int i = 0; i < treepieces_preset_count(); i++) {
        treepieces_species s;
        const char *text = treepieces_preset_text(i);
        assert_int_equal(treepieces_species_parse(text, strlen(text), NULL, &s), TXM_OK);
        for (int seed = 0; seed < seeds; seed++) {
            treepieces_forest_desc d = describe(1, 1200);
            double height, width;
            d.species = &s;
            d.seed = 1 + (uint64_t)seed;
            treepieces_forest *large = grow(&d);
            cone *others = make_cones(large);
            measure(large, others, &height, &width);
            for (int l = 0; l < LIMITS; l++, trees++) {
                double small_height, small_width;
                d.max_pieces = limits[l];
                treepieces_forest *f = grow(&d);
                cone *cones = make_cones(f);
                measure(f, cones, &small_height, &small_width);
                assert_true((int)f->node_count <= limits[l]);
                worst = fmax(worst, fabs(small_height / height - 1));
                too_high += fabs(small_height / height - 1) > 0.02;
                if (limits[l] >= 300) wide += small_width, narrow += width;
                apart = fmax(apart, 1 - share_near(f, cones, large, others, 0.05 * height));
                free(cones);
                treepieces_forest_free(f);
            }
            free(others);
            treepieces_forest_free(large);
        }
    }
    printf("height: %d of %d trees differ by more than 2 %%, at most by %.1f %%; width from 300 pieces on %.2f; "
           "joints elsewhere at most %.1f %%\n",
           too_high, trees, 100 * worst, wide / narrow, 100 * apart);
    assert_true(20 * too_high <= trees);
    assert_true(wide > 0.9 * narrow);
    assert_true(apart < 0.02);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_branches_keep_apart),
        cmocka_unit_test(test_one_skeleton),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
