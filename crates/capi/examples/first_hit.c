/* The nearest hits of two rays on a triangle:
 *
 *   cc -Iinclude examples/first_hit.c -L../../target/release -lsnell -lm -o first_hit
 */
#include <math.h>
#include <snell.h>
#include <stdio.h>

int main(void) {
    const float vertices[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    const uint32_t indices[] = {0, 1, 2};
    const SnellRay rays[] = {
        {0.25f, 0.5f, -2, 0, 0, 0, 1, INFINITY},
        {0.75f, 0.5f, -2, 0, 0, 0, 1, INFINITY},
    };
    SnellHit hits[2];
    uint8_t occluded[2];

    SnellScene *scene = snellNewScene();
    snellAttachTriangleGeometry(scene, vertices, 3, indices, 1);
    if (snellCommitScene(scene) != SNELL_ERROR_NONE ||
        snellIntersect(scene, rays, hits, 2) != SNELL_ERROR_NONE ||
        snellOccluded(scene, rays, occluded, 2) != SNELL_ERROR_NONE) {
        fprintf(stderr, "error: %s\n", snellGetLastErrorMessage());
        snellReleaseScene(scene);
        return 1;
    }
    for (int i = 0; i < 2; i++) {
        if (hits[i].geom_id == SNELL_INVALID_GEOMETRY_ID)
            printf("ray %d misses; occluded %d\n", i, occluded[i]);
        else
            printf("ray %d hits triangle %u at t = %g, u = %g, v = %g; occluded %d\n", i,
                   hits[i].prim_id, hits[i].t, hits[i].u, hits[i].v, occluded[i]);
    }
    snellReleaseScene(scene);
    return 0;
}
