// SPDX-License-Identifier: MIT OR Apache-2.0
// The C interface: a map from three scans of bearings, a fourth view by resection, a landmark by
// triangulation, and a refinement of it all, in fixed memory.
//
//   make capi
//   cc -std=c99 -Iinclude examples/three_views.c target/capi/release/libbearslam_c.a -lm -o three_views
//   ./three_views
//
// Each line is a name and its numbers, with all their digits.

#include "bearslam.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { VIEWS = 4, LANDMARKS = 8, HIDDEN = 7 };

// Standard deviation of a bearing [rad].
static const double SIGMA = 0.001;

// True poses x, y, heading and landmarks x, y, which the robot does not know.
static const double WORLD_POSES[VIEWS][3] = {{0, 0, 0.3}, {4, -0.5, 0.7}, {1.5, 4, -0.4}, {5, 4.5, 2.1}};
static const double WORLD_LANDMARKS[LANDMARKS][2] = {{1.5, 1.5}, {3, 3}, {-1.5, 2}, {5.5, 2}, {2, -2}, {-1, -1}, {6, 1}, {3, 6}};

// Memory of the refinement: enough for the largest problem, aligned as a double.
static double memory[16 * 1024];

static void check(const char *what, BearslamStatus status) {
    if (status != BEARSLAM_STATUS_OK) {
        fprintf(stderr, "%s: %s\n", what, bearslam_status_text(status));
        exit(EXIT_FAILURE);
    }
}

static void print(const char *name, const double *numbers, size_t count) {
    printf("%s", name);
    for (size_t k = 0; k < count; k++) {
        printf(" %.17g", numbers[k]);
    }
    printf("\n");
}

// Bearings with errors of about SIGMA. View 0 does not see the last landmark.
static void scan(double bearings[VIEWS][LANDMARKS]) {
    for (int i = 0; i < VIEWS; i++) {
        for (int j = 0; j < LANDMARKS; j++) {
            const double *pose = WORLD_POSES[i], *landmark = WORLD_LANDMARKS[j];
            double error = SIGMA * sin(37.0 * (LANDMARKS * i + j + 1));
            bearings[i][j] = atan2(landmark[1] - pose[1], landmark[0] - pose[0]) - pose[2] + error;
        }
    }
    bearings[0][HIDDEN] = NAN;
}

int main(void) {
    double bearings[VIEWS][LANDMARKS];
    scan(bearings);
    print("bearings", bearings[0], VIEWS * LANDMARKS);

    // The first three scans.
    double motions[2][3][3], both[2][LANDMARKS][2];
    size_t inconsistent[2], solutions;
    check("three views", bearslam_three_view(bearings[0], LANDMARKS, BEARSLAM_METHOD_CALIBRATED, 2, motions[0][0],
                                             both[0][0], inconsistent, &solutions));
    for (size_t k = 0; k < solutions; k++) {
        printf("inconsistent %zu\n", inconsistent[k]);
        print("poses", motions[k][0], 9);
        print("landmarks", both[k][0], 2 * LANDMARKS);
    }

    // The map so far: three poses of the best solution, and the landmarks that all three see.
    double poses[VIEWS][3], landmarks[LANDMARKS][2];
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            poses[i][k] = motions[0][i][k];
        }
    }
    for (int j = 0; j < LANDMARKS; j++) {
        landmarks[j][0] = both[0][j][0];
        landmarks[j][1] = both[0][j][1];
    }

    // The fourth view, from the landmarks in the map.
    check("resection", bearslam_resect(landmarks[0], bearings[3], HIDDEN, poses[3]));
    print("resected", poses[3], 3);

    // The landmark that view 0 does not see, from the other views.
    double column[VIEWS];
    for (int i = 0; i < VIEWS; i++) {
        column[i] = bearings[i][HIDDEN];
    }
    check("triangulation", bearslam_triangulate(poses[0], column, VIEWS, landmarks[HIDDEN]));
    print("triangulated", landmarks[HIDDEN], 2);

    double cost;
    size_t iterations;
    // At most 30 iterations, to the last digit; a tolerance of 1e-10 would do.
    check("refinement", bearslam_refine(bearings[0], SIGMA, VIEWS, LANDMARKS, poses[0], landmarks[0], 30, 0.0, &cost,
                                        &iterations, memory, sizeof memory));
    print("refined_poses", poses[0], 3 * VIEWS);
    print("refined_landmarks", landmarks[0], 2 * LANDMARKS);
    print("cost", &cost, 1);
    fprintf(stderr, "%zu iterations, %zu bytes of memory\n", iterations, bearslam_refine_size(VIEWS, LANDMARKS));
    return EXIT_SUCCESS;
}
