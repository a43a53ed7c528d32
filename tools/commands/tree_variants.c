/* tree_variants.c - a forest of a few different trees in many places
   SPDX-License-Identifier: MIT OR Unlicense

   The trees stand where those of other forests do, on the library's grid. Each takes the next card of
   a shuffled deck that holds the variants of its species once: all are used about equally often, and
   there is no pattern to see.                                                                    */
#include "tree.h"

/* The variants of one species. */
typedef struct deck {
    int cards[MAX_VARIANTS], count;
    int left; /* the first so many have not been drawn since the deck was shuffled */
} deck;

static int draw(deck *d, txm_rng *rng) {
    if (d->left == 0) d->left = d->count;
    const int i = (int)txm_rng_below(rng, (uint32_t)d->left--), card = d->cards[i];
    d->cards[i] = d->cards[d->left];
    d->cards[d->left] = card;
    return card;
}

/* Which variant each tree is. */
static void choose_variants(const tree_job *j, const treepieces_place *at, unsigned char *variants) {
    deck decks[MAX_SPECIES];
    txm_rng rng = txm_rng_make(j->run.seed, 0x6465636bu);
    memset(decks, 0, sizeof decks);
    for (int k = 0; k < j->variants; k++) {
        deck *d = &decks[k % j->species_count];
        d->cards[d->count++] = k;
    }
    for (int i = 0; i < j->count; i++)
        variants[i] = (unsigned char)draw(&decks[at[i].species], &rng);
}

static void put_place(const treepieces_place *at, size_t i, tree_places *places) {
    double sine, cosine;
    txm_sincos(0.5 * (double)at->turn, &sine, &cosine);
    memcpy(places->translations + 3 * i, at->position, sizeof at->position);
    places->rotations[4 * i + 1] = (float)sine;
    places->rotations[4 * i + 3] = (float)cosine;
    places->scales[i] = at->scale > 0 ? at->scale : 1;
}

/* Sort the places by variant; those of one variant stay in their order. */
static void sort_places(const tree_job *j, const treepieces_place *at, const unsigned char *variants,
                        tree_places *places) {
    size_t next[MAX_VARIANTS];
    for (int i = 0; i < j->count; i++) places->first[variants[i] + 1]++;
    for (int k = 0; k < j->variants; k++) {
        places->first[k + 1] += places->first[k];
        next[k] = places->first[k];
    }
    for (int i = 0; i < j->count; i++) put_place(&at[i], next[variants[i]]++, places);
}

int tree_make_places(tree_job *j, tree_places *places) {
    const treepieces_forest_desc desc = tree_forest_desc(j);
    const size_t count = (size_t)j->count;
    treepieces_place *at = (treepieces_place *)new_array(count, sizeof *at);
    unsigned char *variants = (unsigned char *)new_array(count, 1);
    int status = CLI_DONE;
    memset(places, 0, sizeof *places);
    places->translations = (float *)new_array(count, 3 * sizeof(float));
    places->rotations = (float *)new_array(count, 4 * sizeof(float));
    places->scales = (float *)new_array(count, sizeof(float));
    if (!at || !variants || !places->translations || !places->rotations || !places->scales)
        status = fail_memory(&j->run);
    if (!status)
        status = check_result(&j->run, treepieces_scatter(&desc, &j->run.env, at), j->species[0].name);
    if (!status) {
        choose_variants(j, at, variants);
        sort_places(j, at, variants, places);
    }
    free(at);
    free(variants);
    return status;
}

void tree_free_places(tree_places *places) {
    free(places->translations);
    free(places->rotations);
    free(places->scales);
}
