/*
 * Snell's ray queries for C: scenes of triangles, and batches of rays.
 *
 * Made from crates/capi by `SNELL_HEADER=write cargo test -p snell-capi`; do not edit.
 * Licensed under MIT or Apache-2.0, at your choice.
 */

#ifndef SNELL_H
#define SNELL_H

#include <stddef.h>
#include <stdint.h>

/*
 The id that means "nothing": of a miss, and of a geometry that could not be attached.
 */
#define SNELL_INVALID_GEOMETRY_ID 4294967295

/*
 What a function reports.
 */
typedef enum SnellError {
  /*
   The function did what it was asked to do.
   */
  SNELL_ERROR_NONE = 0,
  /*
   A pointer is null, a size does not fit, or an index points past the vertices.
   */
  SNELL_ERROR_INVALID_ARGUMENT = 1,
  /*
   The scene was never committed, or has changed since.
   */
  SNELL_ERROR_NOT_COMMITTED = 2,
  /*
   A limit of the structure is exceeded, or there is not enough memory.
   */
  SNELL_ERROR_LIMIT = 3,
  /*
   A fault in Snell itself. What went wrong was printed to standard error.
   */
  SNELL_ERROR_INTERNAL = 4,
} SnellError;

/*
 A scene: geometries, and the structure for its rays once it is committed.
 */
typedef struct SnellScene SnellScene;

/*
 A ray. 32 bytes.
 */
typedef struct SnellRay {
  /*
   The origin.
   */
  float org_x;
  float org_y;
  float org_z;
  /*
   Hits at this distance and before are ignored; usually 0.
   */
  float tnear;
  /*
   The direction, of any length but zero. Distances are in units of it.
   */
  float dir_x;
  float dir_y;
  float dir_z;
  /*
   Hits at this distance and beyond are ignored; usually INFINITY.
   */
  float tfar;
} SnellRay;

/*
 The nearest hit of a ray. 20 bytes.
 */
typedef struct SnellHit {
  /*
   The distance, in units of the ray's direction; infinite for a miss.
   */
  float t;
  /*
   Weights of the second and the third vertex; that of the first is 1 - u - v.
   */
  float u;
  float v;
  /*
   The geometry; SNELL_INVALID_GEOMETRY_ID for a miss.
   */
  uint32_t geom_id;
  /*
   The triangle in the geometry; SNELL_INVALID_GEOMETRY_ID for a miss.
   */
  uint32_t prim_id;
} SnellHit;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/*
 Returns what an error code means, in a few words. The text is never released.
 */
const char *snellGetErrorString(uint32_t error);

/*
 Returns the message of the calling thread's last call that returns an error code: what is wrong,
 and where. It is empty if that call succeeded, and valid until the next such call.
 */
const char *snellGetLastErrorMessage(void);

/*
 Returns the version of the library, such as "0.1.0". The text is never released.
 */
const char *snellGetVersion(void);

/*
 Makes an empty scene, to be released by snellReleaseScene.
 */
struct SnellScene *snellNewScene(void);

/*
 Releases a scene; null is allowed.

 # Safety
 The scene is from snellNewScene, was not released, and is not in use.
 */
void snellReleaseScene(struct SnellScene *scene);

/*
 Attaches a mesh: three floats for each vertex, and three vertex numbers for each triangle. Both
 arrays are copied. Returns the number of the geometry, counted from 0, or
 SNELL_INVALID_GEOMETRY_ID after an error. Triangles with a vertex that is not finite are never
 hit. The scene must be committed again before its next query.

 # Safety
 Pointers are null or valid for the sizes given, and no other thread uses the scene.
 */
uint32_t snellAttachTriangleGeometry(struct SnellScene *scene,
                                     const float *vertices,
                                     size_t vertex_count,
                                     const uint32_t *indices,
                                     size_t triangle_count);

/*
 Builds the structure for the rays of a scene, on all cores.

 # Safety
 The scene is null or from snellNewScene, and no other thread uses it.
 */
enum SnellError snellCommitScene(struct SnellScene *scene);

/*
 Finds the nearest hit of each ray, on all cores. Hits are the same bits for any number of
 threads and on any machine; of hits at one distance that of the lowest geometry and triangle
 counts. Invalid rays (not finite, no direction, an empty interval) miss.

 # Safety
 Pointers are null or valid for the count given. Many threads may ask one scene.
 */
enum SnellError snellIntersect(const struct SnellScene *scene,
                               const struct SnellRay *rays,
                               struct SnellHit *hits,
                               size_t count);

/*
 Finds whether anything is in the interval of each ray: 1 if so, 0 if not. It is faster than
 snellIntersect.

 # Safety
 Pointers are null or valid for the count given. Many threads may ask one scene.
 */
enum SnellError snellOccluded(const struct SnellScene *scene,
                              const struct SnellRay *rays,
                              uint8_t *occluded,
                              size_t count);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* SNELL_H */
