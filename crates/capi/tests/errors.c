/* What a program may do wrong, and what it is told. */
#include <math.h>
#include <snell.h>
#include <stdio.h>
#include <string.h>

static int failures = 0;

static void expect(int holds, const char *what) {
    if (!holds) {
        printf("%s; the message is \"%s\"\n", what, snellGetLastErrorMessage());
        failures++;
    }
}

static int says(const char *part) { return strstr(snellGetLastErrorMessage(), part) != NULL; }

int main(void) {
    const float vertices[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    const uint32_t indices[] = {0, 1, 2};
    const uint32_t wrong[] = {0, 1, 3};
    const SnellRay ray = {0.25f, 0.5f, -2, 0, 0, 0, 1, INFINITY};
    const SnellRay bad = {NAN, 0, 0, 0, 0, 0, 1, INFINITY};
    SnellHit hit;
    uint8_t blocked;
    SnellScene *scene = snellNewScene();

    expect(snellCommitScene(NULL) == SNELL_ERROR_INVALID_ARGUMENT && says("scene is null"),
           "a null scene is refused");
    expect(snellIntersect(NULL, &ray, &hit, 1) == SNELL_ERROR_INVALID_ARGUMENT, "null scene");
    expect(snellIntersect(scene, &ray, &hit, 1) == SNELL_ERROR_NOT_COMMITTED &&
               says("snellCommitScene"),
           "a scene must be committed");
    expect(snellAttachTriangleGeometry(scene, vertices, 3, wrong, 1) ==
                   SNELL_INVALID_GEOMETRY_ID &&
               says("vertex 3"),
           "indices are checked");
    expect(snellAttachTriangleGeometry(scene, NULL, 3, indices, 1) == SNELL_INVALID_GEOMETRY_ID &&
               says("vertices is null"),
           "null vertices are refused");
    expect(snellAttachTriangleGeometry(scene, vertices, SIZE_MAX, indices, 1) ==
                   SNELL_INVALID_GEOMETRY_ID &&
               says("do not fit"),
           "sizes are checked");

    expect(snellCommitScene(scene) == SNELL_ERROR_NONE && says(""), "an empty scene is a scene");
    expect(snellIntersect(scene, &ray, &hit, 1) == SNELL_ERROR_NONE && isinf(hit.t) &&
               hit.geom_id == SNELL_INVALID_GEOMETRY_ID,
           "its rays miss");
    expect(snellAttachTriangleGeometry(scene, vertices, 3, indices, 1) == 0, "the first geometry");
    expect(snellAttachTriangleGeometry(scene, NULL, 0, NULL, 0) == 1, "nothing is a geometry");
    expect(snellOccluded(scene, &ray, &blocked, 1) == SNELL_ERROR_NOT_COMMITTED,
           "a changed scene must be committed again");
    expect(snellCommitScene(scene) == SNELL_ERROR_NONE, "the scene is committed");
    expect(snellIntersect(scene, NULL, &hit, 1) == SNELL_ERROR_INVALID_ARGUMENT, "null rays");
    expect(snellIntersect(scene, &ray, NULL, 1) == SNELL_ERROR_INVALID_ARGUMENT, "null hits");
    expect(snellOccluded(scene, NULL, NULL, 0) == SNELL_ERROR_NONE, "no rays are no error");
    expect(snellIntersect(scene, &ray, &hit, 1) == SNELL_ERROR_NONE && hit.t == 2 &&
               hit.geom_id == 0 && hit.prim_id == 0,
           "the triangle is hit");
    expect(snellIntersect(scene, &bad, &hit, 1) == SNELL_ERROR_NONE && isinf(hit.t),
           "an invalid ray misses");
    expect(strcmp(snellGetErrorString(2), "the scene is not committed") == 0, "known errors");
    expect(strcmp(snellGetErrorString(77), "unknown error") == 0, "unknown errors");
    expect(snellGetVersion()[0] != 0, "there is a version");

    snellReleaseScene(scene);
    snellReleaseScene(NULL);
    return failures != 0;
}
