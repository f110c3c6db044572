// SPDX-License-Identifier: MIT OR Apache-2.0
// Planar structure and motion from bearings alone. Made from src/capi/ by `make header`.
//
// Angles are radians. A pose is x, y, heading, a landmark x, y; arrays are row by row. A bearing that is NaN has
// not been seen. Nothing is allocated and no call keeps a pointer. Every pointer must have room for the numbers
// that its argument names, and what a call writes may overlap nothing else that it is given. With any status but
// BEARSLAM_STATUS_OK and BEARSLAM_STATUS_NOT_CONVERGED nothing has been written.

#ifndef BEARSLAM_H
#define BEARSLAM_H

#include <stddef.h>

// Most landmarks of `bearslam_three_view`, whose rays are on the stack.
#define BEARSLAM_MAX_TRIPLES 64

// Most rounds of reweighting of `bearslam_three_view`: a count that went wrong is not worked off.
#define BEARSLAM_MAX_REWEIGHTS 100

// Most views of `bearslam_refine`.
#define BEARSLAM_MAX_VIEWS 16

// Most landmarks of `bearslam_refine`.
#define BEARSLAM_MAX_LANDMARKS 32

// What became of a call.
typedef enum BearslamStatus {
  // All is written.
  BEARSLAM_STATUS_OK = 0,
  // A pointer is null.
  BEARSLAM_STATUS_NULL_POINTER,
  // A pointer is not aligned for what it points at.
  BEARSLAM_STATUS_MISALIGNED,
  // Fewer views or landmarks than the call needs.
  BEARSLAM_STATUS_TOO_FEW,
  // More views, landmarks or rounds than the call can take.
  BEARSLAM_STATUS_TOO_LARGE,
  // A number is infinite, or NaN where that means nothing.
  BEARSLAM_STATUS_NOT_FINITE,
  // The standard deviation is not positive, or the tolerance is negative.
  BEARSLAM_STATUS_NOT_POSITIVE,
  // No such method.
  BEARSLAM_STATUS_UNKNOWN_METHOD,
  // The memory is smaller than `bearslam_refine_size` says.
  BEARSLAM_STATUS_MEMORY_TOO_SMALL,
  // The data do not determine the answer.
  BEARSLAM_STATUS_DEGENERATE,
  // The iterations ran out before the minimum; all is written.
  BEARSLAM_STATUS_NOT_CONVERGED,
  // An error of the library that its calls from C should not meet.
  BEARSLAM_STATUS_UNEXPECTED,
} BearslamStatus;

// How three views are solved.
typedef enum BearslamMethod {
  // The calibrated tensor, from five landmarks.
  BEARSLAM_METHOD_CALIBRATED = 0,
  // The method of Dellaert and Stroupe (ICRA 2002), from seven landmarks.
  BEARSLAM_METHOD_PROJECTIVE,
} BearslamMethod;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The explanation of a status, in a word or a sentence; never null.
const char *bearslam_status_text(int status);

// Poses and landmarks of three views from bearings alone: both motions that explain them, best first.
//
// View 0 is at the origin with heading 0, view 1 at distance 1 from it. Both motions explain the bearings
// modulo pi; the signs nearly always tell them apart, but not always: look at `inconsistent` of both.
//
// - `bearings`: 3 x `landmark_count`, by view. A landmark that one of the views does not see takes no part.
// - `landmark_count`: at most `BEARSLAM_MAX_TRIPLES`.
// - `method`: a `BearslamMethod`; `reweights`: rounds of reweighting of the calibrated one (2 is good), at
//   most `BEARSLAM_MAX_REWEIGHTS`.
// - `poses`: 2 x 3 x 3, by solution, then by view.
// - `landmarks`: 2 x `landmark_count` x 2; NaN where rays are parallel or one is missing.
// - `inconsistent`: 2; how many sightings point away from their landmark.
// - `solutions`: how many there are: 2, or 1 where noise has made the two one. Then the second is NaN.
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

// A landmark from two bearings or more.
//
// - `poses`: `view_count` x 3; those of views that do not see it are not looked at.
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

// A pose from bearings of three known landmarks or more.
//
// - `landmarks`: `landmark_count` x 2; those that are not seen are not looked at.
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

// How many bytes of memory `bearslam_refine` needs; 0 for more views or landmarks than it can take.
size_t bearslam_refine_size(size_t view_count, size_t landmark_count);

// As `bearslam_refine_size`, of `bearslam_refine_f32`.
size_t bearslam_refine_size_f32(size_t view_count, size_t landmark_count);

// Refines poses and landmarks in place: the least sum of squared bearing residuals over sigma.
//
// The first view that takes part ends at the origin with heading 0, the others at a root-mean-square
// distance of 1 from it. Views that see fewer than three landmarks of the map and landmarks seen by fewer
// than two of its views are not held by the bearings and become NaN.
//
// - `bearings`: `view_count` x `landmark_count`, by view.
// - `sigma`: standard deviation of a bearing.
// - `view_count`, `landmark_count`: at most `BEARSLAM_MAX_VIEWS` and `BEARSLAM_MAX_LANDMARKS`.
// - `poses`: `view_count` x 3, `landmarks`: `landmark_count` x 2; one with x NaN takes no part.
// - `max_iterations`: most linear systems to solve, which bounds the time.
// - `tolerance`: ends when a step lowers the cost by less than this part of it; 1e-10 (1e-7 in single
//   precision) is good, 0 goes on until no step lowers it.
// - `cost`: 1; half the sum of squares. `iterations`: 1; linear systems solved.
// - `memory`: `memory_size` bytes, aligned as a `double`, at least `bearslam_refine_size` of them. What is
//   in it before and after means nothing.
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
