#ifndef TREEPIECES_SKETCH_H
#define TREEPIECES_SKETCH_H

#include "kit.h"

/* ---- the sketch of a tree ------------------------------------------------------------------ */

/* A tree is sketched first: axis by axis, the most important ones first, each in full detail from its
   base to its end. Pieces are made of the sketch afterwards, see assemble.h. Where no branch was
   sketched a fork or side branch is a tube, and tubes that follow one another become one, as far as
   the limit on pieces demands. What is sketched does not depend on the limit, only where it stops: so
   trees of all limits have one skeleton, of which small ones lack the least axes. */

/* By how much tubes are longer in trees of fewer pieces. */
static float tpc_stretch(int most) {
    return txm_clampf(sqrtf(2400 / (float)most), 1, 6);
}

/* By how much tubes cut corners, in base radii of the trunk: in large trees so little that they still keep
   clear of others. */
static float tpc_deviation(int most) {
    const float few = 600 / (float)most;
    return 0.15f * few * few * few * few;
}

/* The number of segments in a tube at most; a step is one, or one with a branch and what is left. */
static int tpc_most_joined(float stretch) {
    return (int)(2 * stretch) + 1;
}

/* A piece as the grammar has it. */
typedef struct tpc_segment {
    uint64_t seed;
    float position[3], rotation[4]; /* of the piece, as of the rim in tpc_bud                   */
    float stem[3];                  /* its axis, unit length                                    */
    float radius, length, ratios[TREEPIECES_MAX_LEAVES]; /* metres; over radius                 */
    float part;                     /* of its length that bears the branches, a piece of its own */
    float along, axis_length, step, end_radius;          /* of the axis, see tpc_bud            */
    float longest;                  /* length of a tube that begins here, for the sake of its bark */
    int32_t axis, node;                                  /* node: of its piece, set at the end  */
    uint16_t depth;
    uint8_t type, order, is_forked, leaves;
    uint8_t main;   /* leaf rim where the axis goes on                                          */
    uint8_t begins; /* 1: the first one of a piece                                              */
    uint8_t grown;  /* bit k: an axis begins at leaf rim k                                      */
    uint8_t across; /* log2 of the tiles across an edge of its leaf rims, set at the end        */
} tpc_segment;

/* A chain of segments. */
typedef struct tpc_axis {
    int32_t first, end;  /* its segments                                                        */
    int32_t parent, rim; /* the segment where it begins, or TREEPIECES_NONE, and its leaf rim   */
} tpc_axis;

typedef struct tpc_sketch {
    tpc_segment *segments; /* a chain has consecutive numbers                                   */
    tpc_axis *axes;
    int segment_count, axis_count, pieces; /* pieces: of all that is sketched                   */
    int is_rigid;                          /* every segment is one piece, and every leaf rim one axis */
    int most_joined;                       /* segments in a tube                                */
    float stretch;                         /* longest tube, in steps of its axis                */
    float taper;                           /* least radius of a tube above over that below      */
    float deviation;                       /* of a tube from the joints it replaces, metres     */
} tpc_sketch;

/* Does the type lose branches that are not sketched? */
static int tpc_is_elastic(const tpc_sketch *s, int type) {
    return !s->is_rigid && (type == TREEPIECES_SIDE || type == TREEPIECES_PLANAR || type == TREEPIECES_Y);
}

/* Is it a stem whose branches need only a part of its length? */
static int tpc_bears_branches(const tpc_sketch *s, int type) {
    return !s->is_rigid && (type == TREEPIECES_SIDE || type == TREEPIECES_PLANAR);
}

/* A segment that is, or can be a part of, a tube. */
static int tpc_is_plain(const tpc_sketch *s, const tpc_segment *t) {
    return !s->is_rigid && (t->type == TREEPIECES_I || (tpc_is_elastic(s, t->type) && !t->grown));
}

/* A tube that is made of segments. */
typedef struct tpc_run {
    const tpc_segment *first; /* NULL: none yet */
    float length;
    int count;
} tpc_run;

/* Would the tube with one more segment remain near enough to the joint below that one? */
static int tpc_is_straight(const tpc_sketch *s, const tpc_segment *first, const tpc_segment *t) {
    float joint[3], end[3];
    for (int k = 0; k < 3; k++) {
        joint[k] = t->position[k] - first->position[k];
        end[k] = joint[k] + t->length * t->stem[k];
    }
    const float square = tpc_dot(end, end), dot = tpc_dot(joint, end);
    const float aside = s->deviation;
    return tpc_dot(joint, joint) * square - dot * dot <= aside * aside * square &&
           tpc_dot(first->stem, t->stem) > (first->along > 0 ? 0.86f : 0.97f);
}

/* Does the next segment of a chain begin a piece? Otherwise it becomes a part of the tube. */
static int tpc_run_take(const tpc_sketch *s, tpc_run *run, const tpc_segment *t) {
    const int is_plain = tpc_is_plain(s, t);
    if (run->first && is_plain && run->count < s->most_joined &&
        run->length + t->length <= txm_minf(s->stretch * run->first->step, run->first->longest) &&
        t->radius * t->ratios[t->main] > s->taper * run->first->radius && tpc_is_straight(s, run->first, t)) {
        run->length += t->length;
        run->count++;
        return 0;
    }
    run->first = is_plain ? t : NULL;
    run->length = t->length;
    run->count = 1;
    return 1;
}

/* By how many pieces does the tree grow when an axis begins at a leaf rim of a segment? The tip that
   closes a rim of a piece that loses none is counted already. Where the segment becomes a piece of its
   own, the tube after it begins anew, and so may some that follow; is_made: take note of them. */
static int tpc_split(tpc_sketch *s, int32_t at, int is_made) {
    tpc_segment *t = &s->segments[at];
    if (!tpc_is_elastic(s, t->type)) return -1;
    if (t->grown) return 0;
    const int32_t end = s->axes[t->axis].end;
    tpc_run run = {NULL, 0, 0};
    int more = !t->begins + (t->part < t->length);
    if (is_made) t->begins = 1;
    for (int32_t i = at + 1; i < end; i++) {
        tpc_segment *next = &s->segments[i];
        const int begins = tpc_run_take(s, &run, next);
        if (begins && next->begins) break; /* as before from here on */
        more += begins - next->begins;
        if (is_made) next->begins = (uint8_t)begins;
    }
    return more;
}

#endif /* TREEPIECES_SKETCH_H */
