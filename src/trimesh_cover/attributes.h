#ifndef TRIMESH_COVER_ATTRIBUTES_H
#define TRIMESH_COVER_ATTRIBUTES_H

#include "check.h"

/* ---- attributes ------------------------------------------------------------------------------ */

typedef struct tmc_values {
    const uint32_t *entry; /* which value each corner of the input has */
    const float *values;
    size_t channels;
} tmc_values;

static txm_status tmc_check_values(const txm_mesh *input, const trimesh_values *values,
                                   txm_env *env, tmc_values *out) {
    if (!values) return txm_fail(env, TXM_BAD_ARGUMENT, "values is NULL");
    if (values->channels < 1 || values->channels > TRIMESH_MAX_CHANNELS)
        return txm_fail(env, TXM_BAD_ARGUMENT, "channels must be 1 to TRIMESH_MAX_CHANNELS");
    if (values->count > 3 * (size_t)TRIMESH_MAX_VERTICES)
        return txm_fail(env, TXM_TOO_LARGE, "more than 3 TRIMESH_MAX_VERTICES values");
    if (values->count && !values->values)
        return txm_fail(env, TXM_BAD_ARGUMENT, "the values are NULL");
    if (!values->indices && values->count != input->vertex_count)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "values without indices must be as many as the input has vertices");
    out->entry = values->indices ? values->indices : input->indices;
    out->values = values->values;
    out->channels = (size_t)values->channels;
    for (size_t i = 0; values->indices && i < 3 * input->face_count; i++) {
        if (values->indices[i] >= values->count)
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "values: triangle # names entry #, which is not below count",
                                    i / 3, values->indices[i]);
    }
    for (size_t i = 0; i < values->count; i++) {
        if (!tmc_are_finite(values->values + out->channels * i, out->channels))
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT, "values: entry # is not finite", i, 0);
    }
    return TXM_OK;
}

static txm_status tmc_check_sources(const txm_mesh *input, const txm_mesh_place *sources,
                                    size_t count, txm_env *env) {
    if (count > (size_t)INT32_MAX) return txm_fail(env, TXM_TOO_LARGE, "more than 2^31 sources");
    if (count && !sources) return txm_fail(env, TXM_BAD_ARGUMENT, "sources is NULL");
    for (size_t i = 0; i < count; i++) {
        const txm_mesh_place *s = &sources[i];
        if (s->triangle >= input->face_count)
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "source # names triangle #, which the input does not have", i,
                                    s->triangle);
        if (!(s->u >= 0 && s->v >= 0 && (double)s->u + s->v <= 1 + TMC_SNAP))
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "u and v of source # must be 0 or more, their sum at most 1", i,
                                    0);
    }
    return TXM_OK;
}

/* out = a + u (b - a) + v (c - a): exact where the three are equal */
static void tmc_interpolate(const tmc_values *x, size_t triangle, double u, double v, float *out) {
    const float *a = x->values + x->channels * x->entry[3 * triangle];
    const float *b = x->values + x->channels * x->entry[3 * triangle + 1];
    const float *c = x->values + x->channels * x->entry[3 * triangle + 2];
    for (size_t i = 0; i < x->channels; i++)
        out[i] = txm_float(a[i] + u * ((double)b[i] - a[i]) + v * ((double)c[i] - a[i]));
}

typedef struct tmc_transfer {
    tmc_values values;
    const txm_mesh_place *sources;
    float *out;
} tmc_transfer;

static void tmc_transfer_block(const void *job, size_t first, size_t end) {
    const tmc_transfer *j = (const tmc_transfer *)job;
    for (size_t i = first; i < end; i++) {
        const txm_mesh_place *s = &j->sources[i];
        tmc_interpolate(&j->values, s->triangle, s->u, s->v, j->out + j->values.channels * i);
    }
}

TRIMESH_COVER_API txm_status trimesh_transfer(const txm_mesh *input, const trimesh_values *values,
                                        const txm_mesh_place *sources, size_t count, txm_env *env,
                                        float *out) {
    tmc_transfer j;
    txm_status status = txm_mesh_check(input, "input", 3, 0, TRIMESH_MAX_VERTICES, env);
    if (status == TXM_OK) status = tmc_check_values(input, values, env, &j.values);
    if (status == TXM_OK) status = tmc_check_sources(input, sources, count, env);
    if (status != TXM_OK || count == 0) return status;
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    j.sources = sources;
    j.out = out;
    return tmc_run_blocks(tmc_transfer_block, &j, count, 0, 1, "values", env);
}

#endif /* TRIMESH_COVER_ATTRIBUTES_H */
