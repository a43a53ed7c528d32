#ifndef TREEPIECES_PRESETS_H
#define TREEPIECES_PRESETS_H

#include "../treepieces.h"

/* ---- species: presets -------------------------------------------------------------------- */

/* The default of every key: a small round tree. */
static const char tpc_fresh[] =
    "flare 1.6\n"
    "envelope free\n" "crown_base 0\n" "crown_top 1\n" "crown_width 1\n" "shade 0\n"
    "phototropism 0\n" "clearance 1.2\n"
    "stiffness 1\n"
    "leaf_shape oval\n" "leaf_count 24\n" "leaf_size 0.3\n" "cloud_kind round\n" "cloud 0.5\n"
    "cloud_flat 0.8\n"
    "bark_kind furrowed\n"
    "leaf_color 0.3 0.45 0.15\n" "bark_color 0.4 0.35 0.3\n"
    "order 0\n" "length 8\n" "length_spread 0.1\n" "radius 0.025\n" "taper 0.25\n" "segments 12\n"
    "start 0.25\n" "side 0.45\n" "pair 0.1\n" "fork 0.12\n" "triple 0\n" "fork_angle 25\n"
    "fork_ratio 0.9\n"
    "angle_base 0\n" "angle_top 0\n" "angle_spread 0\n" "profile 1 1 1\n" "roll 0\n"
    "wander 6\n" "tropism 0.05\n" "sag 0\n" "gravimorphism 0\n" "flatten 0\n" "leaves 0\n"
    "leaves_start 0.8\n"
    "order 1\n" "length 0.5\n" "length_spread 0.2\n" "radius 0.5\n" "taper 0.2\n" "segments 7\n"
    "start 0.2\n" "side 0.5\n" "pair 0.1\n" "fork 0.06\n" "triple 0\n" "fork_angle 25\n"
    "fork_ratio 0.9\n"
    "angle_base 65\n" "angle_top 40\n" "angle_spread 10\n" "profile 1 0.9 0.5\n" "roll 137.5\n"
    "wander 9\n" "tropism 0.05\n" "sag 0\n" "gravimorphism 0\n" "flatten 0\n" "leaves 0.5\n"
    "leaves_start 0.5\n"
    "order 2\n" "length 0.45\n" "length_spread 0.25\n" "radius 0.55\n" "taper 0.3\n" "segments 4\n"
    "start 0.2\n" "side 0.5\n" "pair 0\n" "fork 0\n" "triple 0\n" "fork_angle 25\n"
    "fork_ratio 0.9\n"
    "angle_base 55\n" "angle_top 40\n" "angle_spread 12\n" "profile 1 0.9 0.6\n" "roll 137.5\n"
    "wander 12\n" "tropism 0.03\n" "sag 0\n" "gravimorphism 0\n" "flatten 0\n" "leaves 0.8\n"
    "leaves_start 0.2\n";

static const char tpc_oak[] =
    "name oak\n" "phototropism 0.2\n" "flare 1.7\n" "stiffness 1.4\n"
    "envelope ellipsoid\n" "crown_base 0.06\n" "crown_top 1.08\n" "crown_width 1.45\n"
    "leaf_shape lobed\n" "leaf_count 28\n" "leaf_size 0.42\n" "cloud 1.2\n" "cloud_flat 0.8\n"
    "leaf_color 0.29 0.4 0.13\n" "bark_color 0.4 0.35 0.29\n"
    "order 0\n" "length 15\n" "radius 0.034\n" "taper 0.05\n" "segments 15\n"
    "start 0.2\n" "side 0.5\n" "pair 0.05\n" "fork 0.35\n" "fork_angle 30\n" "fork_ratio 0.95\n"
    "wander 9\n" "tropism 0.03\n" "leaves 0.9\n" "leaves_start 0.85\n"
    "order 1\n" "length 0.72\n" "length_spread 0.2\n" "radius 0.55\n" "taper 0.06\n" "segments 12\n"
    "start 0.15\n" "side 0.5\n" "pair 0.05\n" "fork 0.22\n" "fork_angle 28\n"
    "angle_base 80\n" "angle_top 40\n" "angle_spread 10\n" "profile 1 1 0.75\n" "roll 137.5\n"
    "wander 15\n" "tropism 0.06\n" "leaves 0.7\n" "leaves_start 0.5\n"
    "order 2\n" "gravimorphism 0.5\n"
    "length 0.45\n" "radius 0.5\n" "taper 0.1\n" "segments 7\n"
    "start 0.1\n" "side 0.55\n" "fork 0.15\n"
    "angle_base 65\n" "angle_top 45\n" "angle_spread 15\n" "profile 1 0.9 0.5\n"
    "wander 17\n" "tropism 0.1\n" "leaves 0.6\n" "leaves_start 0.3\n"
    "order 3\n" "gravimorphism 0.5\n"
    "length 0.5\n" "radius 0.5\n" "taper 0.2\n" "segments 4\n" "side 0.4\n"
    "angle_base 55\n" "angle_top 45\n"
    "wander 18\n" "tropism 0.08\n" "leaves 0.6\n" "leaves_start 0.2\n"
    "order 4\n" "gravimorphism 0.3\n" "length 0.5\n" "radius 0.55\n" "segments 3\n"
    "wander 16\n" "leaves 0.5\n";

static const char tpc_beech[] =
    "name beech\n" "phototropism 0.15\n" "flare 1.8\n" "stiffness 1.2\n"
    "envelope ellipsoid\n" "crown_base 0.06\n" "crown_top 1.08\n" "crown_width 0.95\n"
    "leaf_shape oval\n" "leaf_count 48\n" "leaf_size 0.36\n" "cloud_kind layers\n" "cloud 1.25\n"
    "cloud_flat 0.5\n"
    "leaf_color 0.28 0.39 0.14\n" "bark_kind smooth\n" "bark_color 0.47 0.48 0.46\n"
    "order 0\n" "length 20\n" "radius 0.024\n" "taper 0.04\n" "segments 26\n"
    "start 0.14\n" "side 0.8\n" "pair 0.05\n" "fork 0.08\n" "fork_angle 20\n" "fork_ratio 0.95\n"
    "wander 4\n" "tropism 0.08\n" "leaves 0.9\n" "leaves_start 0.9\n"
    "order 1\n" "length 0.6\n" "radius 0.42\n" "taper 0.05\n" "segments 13\n"
    "start 0.12\n" "side 0.7\n" "pair 0.05\n" "fork 0.1\n" "fork_angle 22\n"
    "angle_base 66\n" "angle_top 28\n" "angle_spread 8\n" "profile 1 1 0.4\n"
    "wander 8\n" "tropism 0.05\n" "leaves 0.8\n" "leaves_start 0.5\n"
    "order 2\n" "length 0.42\n" "radius 0.45\n" "taper 0.08\n" "segments 7\n"
    "start 0.1\n" "side 0.6\n" "fork 0.06\n"
    "angle_base 60\n" "angle_top 40\n" "profile 1 0.9 0.4\n"
    "wander 9\n" "tropism 0.02\n" "flatten 0.4\n" "leaves 0.8\n" "leaves_start 0.3\n"
    "order 3\n" "length 0.45\n" "radius 0.45\n" "taper 0.15\n" "segments 5\n"
    "side 0.4\n" "angle_base 50\n" "angle_top 40\n"
    "wander 10\n" "sag 15\n" "flatten 0.5\n" "leaves 0.6\n" "leaves_start 0.2\n";

static const char tpc_maple[] =
    "name maple\n" "phototropism 0.2\n" "flare 1.5\n"
    "envelope ellipsoid\n" "crown_base 0.12\n" "crown_top 1.1\n" "crown_width 0.85\n"
    "leaf_shape palmate\n" "leaf_count 24\n" "leaf_size 0.42\n" "cloud 1\n" "cloud_flat 0.85\n"
    "leaf_color 0.74 0.4 0.12\n" "bark_color 0.42 0.38 0.33\n"
    "order 0\n" "length 15\n" "radius 0.02\n" "taper 0.05\n" "segments 20\n"
    "start 0.16\n" "side 0.2\n" "pair 0.5\n" "fork 0.06\n" "fork_angle 20\n" "fork_ratio 0.95\n"
    "wander 4\n" "tropism 0.1\n" "leaves 0.9\n" "leaves_start 0.85\n"
    "order 1\n" "length 0.55\n" "radius 0.42\n" "taper 0.05\n" "segments 11\n"
    "start 0.2\n" "side 0.15\n" "pair 0.4\n" "fork 0.12\n"
    "angle_base 55\n" "angle_top 30\n" "profile 0.9 1 0.5\n" "roll 90\n"
    "wander 7\n" "tropism 0.08\n" "leaves 0.6\n" "leaves_start 0.4\n"
    "order 2\n" "length 0.42\n" "radius 0.42\n" "taper 0.1\n" "segments 7\n"
    "start 0.15\n" "side 0.1\n" "pair 0.4\n" "fork 0.06\n"
    "angle_base 50\n" "angle_top 40\n" "profile 1 0.9 0.5\n" "roll 90\n"
    "wander 8\n" "tropism 0.08\n" "leaves 0.6\n" "leaves_start 0.3\n"
    "order 3\n" "length 0.5\n" "radius 0.45\n" "taper 0.2\n" "segments 4\n"
    "side 0.1\n" "pair 0.25\n" "angle_base 45\n" "angle_top 40\n" "roll 90\n"
    "wander 10\n" "tropism 0.08\n" "leaves 0.7\n" "leaves_start 0.2\n";

static const char tpc_birch[] =
    "name birch\n" "phototropism 0.1\n" "flare 1.3\n" "stiffness 0.7\n"
    "envelope ellipsoid\n" "crown_base 0.1\n" "crown_top 1.12\n" "crown_width 0.5\n"
    "leaf_shape heart\n" "leaf_count 12\n" "leaf_size 0.5\n" "cloud 0.75\n" "cloud_flat 1.3\n"
    "leaf_color 0.4 0.52 0.16\n" "bark_kind lenticels\n" "bark_color 0.85 0.83 0.79\n"
    "order 0\n" "length 18\n" "radius 0.01\n" "taper 0.03\n" "segments 38\n"
    "start 0.2\n" "side 0.9\n" "pair 0.05\n" "fork 0\n"
    "wander 3\n" "tropism 0.12\n" "leaves 0.9\n" "leaves_start 0.9\n"
    "order 1\n" "length 0.3\n" "radius 0.36\n" "taper 0.06\n" "segments 11\n"
    "start 0.1\n" "side 0.9\n" "fork 0.02\n"
    "angle_base 58\n" "angle_top 30\n" "angle_spread 7\n" "profile 1 0.9 0.25\n"
    "wander 7\n" "tropism 0.06\n" "sag 30\n" "leaves 0.35\n" "leaves_start 0.6\n"
    "order 2\n" "length 0.42\n" "radius 0.38\n" "taper 0.12\n" "segments 6\n"
    "start 0.05\n" "side 0.8\n" "angle_base 50\n" "angle_top 35\n" "profile 1 1 0.6\n"
    "wander 10\n" "sag 100\n" "tropism -0.06\n" "leaves 0.4\n" "leaves_start 0.3\n"
    "order 3\n" "length 0.7\n" "radius 0.45\n" "taper 0.3\n" "segments 5\n" "side 0\n"
    "angle_base 45\n" "angle_top 35\n" "profile 1 1 0.7\n"
    "wander 9\n" "sag 110\n" "tropism -0.14\n" "leaves 0.5\n" "leaves_start 0.2\n";

static const char tpc_poplar[] =
    "name poplar\n" "flare 1.5\n" "stiffness 0.9\n"
    "leaf_shape heart\n" "leaf_count 26\n" "leaf_size 0.45\n" "cloud 0.85\n" "cloud_flat 1.4\n"
    "leaf_color 0.3 0.44 0.14\n" "bark_color 0.45 0.42 0.36\n"
    "order 0\n" "length 24\n" "radius 0.013\n" "taper 0.03\n" "segments 50\n"
    "start 0.04\n" "side 0.6\n" "pair 0.4\n" "fork 0\n"
    "wander 1.5\n" "tropism 0.25\n" "leaves 0.9\n" "leaves_start 0.9\n"
    "order 1\n" "length_spread 0.12\n" "length 0.26\n" "radius 0.32\n" "taper 0.06\n"
    "segments 10\n" "start 0.15\n" "side 0.6\n" "fork 0\n"
    "angle_base 30\n" "angle_top 18\n" "angle_spread 5\n" "profile 0.8 1 0.14\n"
    "wander 4\n" "tropism 0.16\n" "leaves 0.7\n" "leaves_start 0.12\n"
    "order 2\n" "length 0.4\n" "radius 0.42\n" "taper 0.12\n" "segments 6\n"
    "start 0.1\n" "side 0.4\n" "angle_base 32\n" "angle_top 25\n" "profile 1 0.9 0.5\n"
    "wander 6\n" "tropism 0.14\n" "leaves 0.7\n" "leaves_start 0.3\n"
    "order 3\n" "length 0.4\n" "radius 0.5\n" "taper 0.3\n" "segments 3\n"
    "angle_base 32\n" "angle_top 25\n" "wander 7\n" "tropism 0.12\n" "leaves 0.6\n";

static const char tpc_willow[] =
    "name willow\n" "phototropism 0.1\n" "flare 1.6\n" "stiffness 0.6\n"
    "envelope ellipsoid\n" "crown_base 0\n" "crown_top 1.05\n" "crown_width 1.6\n"
    "leaf_shape lance\n" "leaf_count 16\n" "leaf_size 0.9\n" "cloud_kind strips\n" "cloud 1\n"
    "cloud_flat 2\n"
    "leaf_color 0.42 0.5 0.18\n" "bark_color 0.42 0.37 0.29\n"
    "order 0\n" "length 10\n" "radius 0.045\n" "taper 0.08\n" "segments 13\n"
    "start 0.18\n" "side 0.5\n" "pair 0.05\n" "fork 0.45\n" "fork_angle 28\n" "fork_ratio 0.85\n"
    "wander 8\n" "tropism 0.03\n" "leaves 0.6\n" "leaves_start 0.7\n"
    "order 1\n" "length 0.7\n" "radius 0.5\n" "taper 0.1\n" "segments 10\n"
    "start 0.15\n" "side 0.75\n" "pair 0.25\n" "fork 0.06\n"
    "angle_base 50\n" "angle_top 45\n" "profile 1 1 0.7\n"
    "wander 9\n" "tropism 0.1\n" "sag 75\n" "leaves 0.45\n" "leaves_start 0.35\n"
    "order 2\n" "length 0.85\n" "radius 0.4\n" "taper 0.12\n" "segments 8\n"
    "start 0.1\n" "side 0.3\n" "angle_base 60\n" "angle_top 40\n" "profile 1 1 0.8\n"
    "wander 5\n" "tropism -0.16\n" "sag 70\n" "gravimorphism 0.3\n" "leaves 0.85\n"
    "leaves_start 0.15\n"
    "order 3\n" "length 0.6\n" "radius 0.5\n" "taper 0.3\n" "segments 5\n"
    "angle_base 30\n" "angle_top 30\n"
    "wander 5\n" "tropism -0.3\n" "leaves 0.85\n" "leaves_start 0\n";

static const char tpc_almond[] =
    "name almond\n" "phototropism 0.1\n" "flare 1.4\n"
    "leaf_shape blossom\n" "leaf_count 44\n" "leaf_size 0.28\n" "cloud 0.42\n" "cloud_flat 0.9\n"
    "leaf_color 0.94 0.76 0.8\n" "bark_kind lenticels\n" "bark_color 0.3 0.25 0.22\n"
    "order 0\n" "length 5.5\n" "radius 0.026\n" "taper 0.06\n" "segments 14\n"
    "start 0.2\n" "side 0.35\n" "fork 0.42\n" "triple 0.1\n" "fork_angle 32\n" "fork_ratio 0.95\n"
    "wander 8\n" "tropism 0.1\n" "leaves 0.3\n" "leaves_start 0.6\n"
    "order 1\n" "length 0.5\n" "radius 0.45\n" "taper 0.1\n" "segments 9\n"
    "start 0.1\n" "side 0.6\n" "fork 0.15\n" "fork_angle 28\n"
    "angle_base 55\n" "angle_top 40\n" "profile 1 1 0.6\n"
    "wander 11\n" "tropism 0.08\n" "leaves 0.5\n" "leaves_start 0.3\n"
    "order 2\n" "length 0.45\n" "radius 0.5\n" "taper 0.15\n" "segments 5\n"
    "side 0.55\n" "fork 0.05\n" "angle_base 50\n" "angle_top 40\n" "profile 1 0.9 0.5\n"
    "wander 12\n" "tropism 0.08\n" "leaves 0.6\n" "leaves_start 0.2\n"
    "order 3\n" "length 0.5\n" "radius 0.55\n" "taper 0.3\n" "segments 3\n"
    "angle_base 45\n" "angle_top 40\n" "wander 12\n" "tropism 0.06\n" "leaves 0.6\n";

static const char tpc_pine[] =
    "name pine\n" "phototropism 0.15\n" "flare 1.4\n"
    "leaf_shape needle\n" "leaf_count 32\n" "leaf_size 0.66\n" "cloud_kind shoots\n" "cloud 0.95\n"
    "cloud_flat 0.32\n"
    "leaf_color 0.23 0.335 0.185\n" "bark_kind plates\n" "bark_color 0.55 0.36 0.24\n"
    "order 0\n" "length 18\n" "radius 0.018\n" "taper 0.06\n" "segments 30\n"
    "start 0.5\n" "side 0.35\n" "pair 0.25\n" "fork 0.1\n" "fork_angle 30\n"
    "wander 5\n" "tropism 0.08\n" "leaves 0.9\n" "leaves_start 0.9\n"
    "order 1\n" "length 0.34\n" "radius 0.42\n" "taper 0.1\n" "segments 9\n"
    "start 0.35\n" "side 0.3\n" "pair 0.25\n" "fork 0.12\n" "fork_angle 28\n"
    "angle_base 88\n" "angle_top 50\n" "angle_spread 10\n" "profile 0.8 1 0.7\n"
    "wander 14\n" "tropism 0.06\n" "flatten 0.3\n" "leaves 0.25\n" "leaves_start 0.75\n" "sag -25\n"
    "order 2\n" "length 0.42\n" "radius 0.45\n" "taper 0.15\n" "segments 5\n"
    "start 0.2\n" "side 0.3\n" "pair 0.15\n"
    "angle_base 60\n" "angle_top 45\n" "profile 1 0.9 0.5\n"
    "wander 14\n" "tropism 0.1\n" "flatten 0.85\n" "leaves 0.6\n" "leaves_start 0.6\n"
    "order 3\n" "length 0.5\n" "radius 0.5\n" "taper 0.3\n" "segments 3\n"
    "angle_base 50\n" "angle_top 40\n"
    "wander 12\n" "tropism 0.12\n" "leaves 0.6\n" "leaves_start 0.4\n" "flatten 0.8\n";

static const char tpc_spruce[] =
    "name spruce\n" "flare 1.4\n"
    "leaf_shape needle\n" "leaf_count 26\n" "leaf_size 0.9\n" "cloud_kind layers\n" "cloud 0.6\n"
    "cloud_flat 0.5\n"
    "leaf_color 0.19 0.295 0.18\n" "bark_kind plates\n" "bark_color 0.38 0.3 0.25\n"
    "order 0\n" "length 22\n" "radius 0.014\n" "taper 0.03\n" "segments 64\n"
    "start 0.04\n" "side 0.05\n" "pair 0.95\n" "fork 0\n"
    "wander 1\n" "tropism 0.3\n" "leaves 1\n" "leaves_start 0.96\n"
    "order 1\n" "length 0.2\n" "radius 0.38\n" "taper 0.12\n" "segments 9\n"
    "start 0.05\n" "side 0.1\n" "pair 0.8\n" "fork 0\n"
    "angle_base 95\n" "angle_top 55\n" "angle_spread 6\n" "profile 1 0.56 0.08\n" "roll 80\n"
    "wander 4\n" "sag -22\n" "leaves 0.9\n" "leaves_start 0\n"
    "order 2\n" "length 0.38\n" "radius 0.4\n" "taper 0.3\n" "segments 3\n"
    "side 0\n" "pair 0\n"
    "angle_base 60\n" "angle_top 50\n" "profile 1 0.8 0.3\n" "roll 15\n"
    "wander 6\n" "sag 25\n" "flatten 0.7\n" "leaves 0.8\n" "leaves_start 0.1\n";

static const char tpc_dead[] =
    "name dead\n" "phototropism 0.1\n" "flare 1.7\n" "stiffness 2\n" "leaf_count 0\n"
    "bark_color 0.5 0.47 0.43\n"
    "order 0\n" "length 9\n" "radius 0.036\n" "taper 0.3\n" "segments 12\n"
    "start 0.3\n" "side 0.55\n" "fork 0.18\n" "fork_angle 28\n" "fork_ratio 0.85\n"
    "wander 12\n" "tropism 0.02\n"
    "order 1\n" "length 0.42\n" "length_spread 0.6\n" "radius 0.45\n" "taper 0.3\n" "segments 7\n"
    "start 0.3\n" "side 0.35\n" "fork 0.12\n"
    "angle_base 80\n" "angle_top 40\n" "angle_spread 18\n" "profile 1 1 0.6\n"
    "wander 20\n" "tropism 0.03\n"
    "order 2\n" "length 0.4\n" "length_spread 0.6\n" "radius 0.45\n" "taper 0.4\n" "segments 4\n"
    "side 0.25\n" "angle_base 60\n" "angle_top 45\n" "angle_spread 20\n" "wander 22\n"
    "order 3\n" "length 0.4\n" "radius 0.5\n" "taper 0.4\n" "segments 3\n" "wander 20\n";

static const struct {
    const char *name, *text;
} tpc_presets[] = {
    {"oak", tpc_oak},
    {"beech", tpc_beech},
    {"maple", tpc_maple},
    {"birch", tpc_birch},
    {"poplar", tpc_poplar},
    {"willow", tpc_willow},
    {"almond", tpc_almond},
    {"pine", tpc_pine},
    {"spruce", tpc_spruce},
    {"dead", tpc_dead},
};

TREEPIECES_API int treepieces_preset_count(void) {
    return (int)(sizeof tpc_presets / sizeof tpc_presets[0]);
}

TREEPIECES_API const char *treepieces_preset_text(int index) {
    return index >= 0 && index < treepieces_preset_count() ? tpc_presets[index].text : NULL;
}

#endif /* TREEPIECES_PRESETS_H */
