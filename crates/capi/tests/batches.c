/* More rays than are copied at a time, at a grid of triangles: some hit, some miss. */
#include <math.h>
#include <snell.h>
#include <stdio.h>
#include <stdlib.h>

enum { CELLS = 64, RAYS = 600000 };

static float noise(uint32_t *state) {
    *state = *state * 1664525u + 1013904223u;
    return (float)(*state >> 8) / (1 << 24);
}

int main(void) {
    float *vertices = malloc(sizeof(float) * 9 * CELLS * CELLS);
    uint32_t *indices = malloc(sizeof(uint32_t) * 3 * CELLS * CELLS);
    SnellRay *rays = malloc(sizeof(SnellRay) * RAYS);
    SnellHit *hits = malloc(sizeof(SnellHit) * RAYS);
    uint8_t *occluded = malloc(RAYS);
    SnellScene *scene = snellNewScene();
    uint32_t state = 1;
    int wrong = 0, found = 0;
    if (!vertices || !indices || !rays || !hits || !occluded) return 2;

    for (uint32_t i = 0; i < CELLS * CELLS; i++) {
        const float x = (float)(i % CELLS), y = (float)(i / CELLS);
        const float corners[9] = {x, y, 0, x + 1, y, 0, x, y + 1, 0};
        for (uint32_t j = 0; j < 9; j++) vertices[9 * i + j] = corners[j];
        for (uint32_t j = 0; j < 3; j++) indices[3 * i + j] = 3 * i + j;
    }
    for (int i = 0; i < RAYS; i++) {
        rays[i] = (SnellRay){noise(&state) * CELLS, noise(&state) * CELLS, -1, 0, 0, 0, 1,
                             INFINITY};
    }
    snellAttachTriangleGeometry(scene, vertices, 3 * CELLS * CELLS, indices, CELLS * CELLS);
    if (snellCommitScene(scene) || snellIntersect(scene, rays, hits, RAYS) ||
        snellOccluded(scene, rays, occluded, RAYS)) {
        printf("%s\n", snellGetLastErrorMessage());
        return 1;
    }
    for (int i = 0; i < RAYS; i++) {
        /* Half of each cell is a triangle: the one with x + y < 1. */
        const float u = rays[i].org_x - floorf(rays[i].org_x);
        const float v = rays[i].org_y - floorf(rays[i].org_y);
        const uint32_t cell =
            (uint32_t)rays[i].org_x + CELLS * (uint32_t)rays[i].org_y;
        const int is_hit = hits[i].geom_id == 0;
        if (fabsf(u + v - 1) < 1e-4f) continue; /* too near to its edge for this arithmetic */
        found += is_hit;
        wrong += is_hit != (u + v < 1) || is_hit != occluded[i];
        wrong += is_hit && (hits[i].prim_id != cell || hits[i].t != 1);
    }
    printf("%d wrong of %d, %d hits\n", wrong, RAYS, found);
    snellReleaseScene(scene);
    free(vertices), free(indices), free(rays), free(hits), free(occluded);
    return wrong != 0 || found < RAYS / 3;
}
