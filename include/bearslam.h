// SPDX-License-Identifier: MIT OR Apache-2.0
// Planar structure and motion from bearings alone. Generated from src/capi/ by `make header`.
//
// Angles are in radians. A pose is x, y, heading, a landmark x, y; arrays are row by row. A bearing is NaN where a
// view does not see a landmark. Nothing is allocated and no call keeps a pointer. Every pointer must have room for
// the numbers that the description of its argument states, and what a call writes must not overlap any of its other
// arguments. With any status other than BEARSLAM_STATUS_OK and BEARSLAM_STATUS_NOT_CONVERGED nothing has been
// written.

#ifndef BEARSLAM_H
#define BEARSLAM_H

#include <stddef.h>

// Maximum number of landmarks of `bearslam_three_view`, whose rays are on the stack.
#define BEARSLAM_MAX_TRIPLES 64

// Maximum number of rounds of reweighting of `bearslam_three_view`, so that a wrong argument cannot stall it.
#define BEARSLAM_MAX_REWEIGHTS 100

// Maximum number of views of `bearslam_refine`.
#define BEARSLAM_MAX_VIEWS 16

// Maximum number of landmarks of `bearslam_refine`.
#define BEARSLAM_MAX_LANDMARKS 32

// Result of a call.
typedef enum BearslamStatus {
  // Success: all results are written.
  BEARSLAM_STATUS_OK = 0,
  // A pointer is null.
  BEARSLAM_STATUS_NULL_POINTER,
  // A pointer is not aligned for its type.
  BEARSLAM_STATUS_MISALIGNED,
  // Fewer views or landmarks than the call needs.
  BEARSLAM_STATUS_TOO_FEW,
  // More views, landmarks or rounds than the call can take.
  BEARSLAM_STATUS_TOO_LARGE,
  // A number is infinite, or NaN where NaN is not allowed.
  BEARSLAM_STATUS_NOT_FINITE,
  // The standard deviation is not positive, or the tolerance is negative.
  BEARSLAM_STATUS_NOT_POSITIVE,
  // Unknown method.
  BEARSLAM_STATUS_UNKNOWN_METHOD,
  // The memory is smaller than `bearslam_refine_size` requires.
  BEARSLAM_STATUS_MEMORY_TOO_SMALL,
  // The data do not determine the answer.
  BEARSLAM_STATUS_DEGENERATE,
  // The lines of sight intersect behind a view: the rays do not.
  BEARSLAM_STATUS_BEHIND,
  // The maximum number of iterations was reached before a minimum; all results are written.
  BEARSLAM_STATUS_NOT_CONVERGED,
  // An error of the library that calls from C should never cause.
  BEARSLAM_STATUS_UNEXPECTED,
} BearslamStatus;

// Method for three views.
typedef enum BearslamMethod {
  // The calibrated tensor, from five landmarks.
  BEARSLAM_METHOD_CALIBRATED = 0,
  // The method of Dellaert and Stroupe (ICRA 2002), from seven landmarks.
  BEARSLAM_METHOD_PROJECTIVE,
} BearslamMethod;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The explanation of a status, as a short text; never null.
const char *bearslam_status_text(int status);

// Poses and landmarks of three views from bearings alone: both motions that explain them, the better first.
//
// View 0 is at the origin with heading 0, view 1 at distance 1 from it. Both motions explain the bearings
// modulo pi. The signs distinguish them nearly always, but not always: check `inconsistent` of both.
//
// - `bearings`: 3 x `landmark_count`, by view. A landmark not seen by all three views is ignored.
// - `landmark_count`: at most `BEARSLAM_MAX_TRIPLES`.
// - `method`: a `BearslamMethod`; `reweights`: rounds of reweighting of the calibrated method (2 is good), at
//   most `BEARSLAM_MAX_REWEIGHTS`.
// - `poses`: 2 x 3 x 3, by solution, then by view.
// - `landmarks`: 2 x `landmark_count` x 2; NaN where the rays are parallel or one is missing.
// - `inconsistent`: 2; how many sightings point away from their landmark.
// - `solutions`: 1; the number of solutions: 2, or 1 where noise has merged them, and the second is then NaN.
//
// # Safety
// See the head of this file.
enum BearslamStatus bearslam_three_view(const double *bearings,
                                        size_t landmark_count,
                                        int method,
                                        size_t reweights,
                                        double *poses,
                                        double *landmarks,
                                        size_t *inconsistent,
                                        size_t *solutions);

// As `bearslam_three_view`, in single precision.
//
// # Safety
// See the head of this file.
enum BearslamStatus bearslam_three_view_f32(const float *bearings,
                                            size_t landmark_count,
                                            int method,
                                            size_t reweights,
                                            float *poses,
                                            float *landmarks,
                                            size_t *inconsistent,
                                            size_t *solutions);

// A landmark by triangulation from at least two bearings.
//
// The status is `BEARSLAM_STATUS_BEHIND` when the lines of sight intersect behind a view, as with diverging rays;
// noise can make the rays to a far landmark diverge.
//
// - `poses`: `view_count` x 3; those of views that do not see the landmark are ignored.
// - `bearings`: `view_count`.
// - `point`: 2.
//
// # Safety
// See the head of this file.
enum BearslamStatus bearslam_triangulate(const double *poses, const double *bearings, size_t view_count, double *point);

// As `bearslam_triangulate`, in single precision.
//
// # Safety
// See the head of this file.
enum BearslamStatus bearslam_triangulate_f32(const float *poses,
                                             const float *bearings,
                                             size_t view_count,
                                             float *point);

// A pose by resection from bearings of at least three known landmarks.
//
// - `landmarks`: `landmark_count` x 2; those that are not seen are ignored.
// - `bearings`: `landmark_count`.
// - `pose`: 3.
//
// # Safety
// See the head of this file.
enum BearslamStatus bearslam_resect(const double *landmarks,
                                    const double *bearings,
                                    size_t landmark_count,
                                    double *pose);

// As `bearslam_resect`, in single precision.
//
// # Safety
// See the head of this file.
enum BearslamStatus bearslam_resect_f32(const float *landmarks,
                                        const float *bearings,
                                        size_t landmark_count,
                                        float *pose);

// The number of bytes of memory that `bearslam_refine` needs; 0 for more views or landmarks than it can take.
size_t bearslam_refine_size(size_t view_count, size_t landmark_count);

// As `bearslam_refine_size`, for `bearslam_refine_f32`.
size_t bearslam_refine_size_f32(size_t view_count, size_t landmark_count);

// Refines poses and landmarks in place: minimises the sum of squared bearing residuals over sigma.
//
// In the result the first determined view is at the origin with heading 0, the others at a root-mean-square
// distance of 1 from it. Views that see fewer than three landmarks of the map and landmarks seen by fewer
// than two of its views are not determined by the bearings and become NaN.
//
// - `bearings`: `view_count` x `landmark_count`, by view.
// - `sigma`: standard deviation of a bearing.
// - `view_count`, `landmark_count`: at most `BEARSLAM_MAX_VIEWS` and `BEARSLAM_MAX_LANDMARKS`.
// - `poses`: `view_count` x 3, `landmarks`: `landmark_count` x 2; one whose x is NaN is left out.
// - `max_iterations`: maximum number of linear systems to solve, which bounds the time.
// - `tolerance`: ends when a step lowers the cost by less than this fraction of it; 1e-10 (1e-7 in single
//   precision) is good, 0 continues until no step lowers it.
// - `cost`: 1; half the sum of squares. `iterations`: 1; linear systems solved.
// - `memory`: `memory_size` bytes, aligned as a `double`, at least `bearslam_refine_size` of them. Its
//   contents before and after the call do not matter.
//
// # Safety
// See the head of this file.
enum BearslamStatus bearslam_refine(const double *bearings,
                                    double sigma,
                                    size_t view_count,
                                    size_t landmark_count,
                                    double *poses,
                                    double *landmarks,
                                    size_t max_iterations,
                                    double tolerance,
                                    double *cost,
                                    size_t *iterations,
                                    void *memory,
                                    size_t memory_size);

// As `bearslam_refine`, in single precision.
//
// # Safety
// See the head of this file.
enum BearslamStatus bearslam_refine_f32(const float *bearings,
                                        float sigma,
                                        size_t view_count,
                                        size_t landmark_count,
                                        float *poses,
                                        float *landmarks,
                                        size_t max_iterations,
                                        float tolerance,
                                        float *cost,
                                        size_t *iterations,
                                        void *memory,
                                        size_t memory_size);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* BEARSLAM_H */
