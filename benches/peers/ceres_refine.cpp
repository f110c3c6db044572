// SPDX-License-Identifier: MIT OR Apache-2.0
//
// Refinement by Ceres of every scene of a file that scenes.py wrote.
//
//   ceres_refine FILE [--repeat N] [--solver dense_schur|dense_normal|dense_qr] [--gauge fixed|free]
//
// One residual block per sighting, analytic derivatives, wrapped residual; landmarks are eliminated first.
// Only Solve() is timed: problem, ordering and options exist before, and the start is copied in between.
// Prints one line per scene: m n median_us least_us iterations cost, with the cost as the sum of squared
// residuals [rad^2] and the times over N repetitions.

#include <ceres/ceres.h>
#include <glog/logging.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

namespace {

struct Scene {
  int m = 0, n = 0;
  std::vector<double> bearings, poses, landmarks;
};

double Wrap(double angle) { return std::remainder(angle, 2.0 * M_PI); }

// Wrapped difference between the direction of a landmark from a pose and the measured bearing.
class Sighting : public ceres::SizedCostFunction<1, 3, 2> {
 public:
  explicit Sighting(double bearing) : bearing_(bearing) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const double* pose = parameters[0];
    const double* landmark = parameters[1];
    const double dx = landmark[0] - pose[0];
    const double dy = landmark[1] - pose[1];
    residuals[0] = Wrap(std::atan2(dy, dx) - pose[2] - bearing_);
    if (jacobians != nullptr) {
      const double inverse_square = 1.0 / (dx * dx + dy * dy);
      const double gx = -dy * inverse_square, gy = dx * inverse_square;
      if (jacobians[0] != nullptr) {
        jacobians[0][0] = -gx;
        jacobians[0][1] = -gy;
        jacobians[0][2] = -1.0;
      }
      if (jacobians[1] != nullptr) {
        jacobians[1][0] = gx;
        jacobians[1][1] = gy;
      }
    }
    return true;
  }

 private:
  double bearing_;
};

std::vector<double> ReadNumbers(std::ifstream& in, int count) {
  std::vector<double> values(count);
  for (double& value : values) {
    if (!(in >> value)) {
      std::fprintf(stderr, "ceres_refine: expected a number\n");
      std::exit(2);
    }
  }
  return values;
}

std::vector<Scene> ReadScenes(const char* path) {
  std::ifstream in(path);
  if (!in) {
    std::fprintf(stderr, "ceres_refine: cannot open %s\n", path);
    std::exit(2);
  }
  std::vector<Scene> scenes;
  for (std::string word; in >> word;) {
    if (word != "scene") {
      std::fprintf(stderr, "ceres_refine: expected 'scene', got '%s'\n", word.c_str());
      std::exit(2);
    }
    const std::vector<double> size = ReadNumbers(in, 2);
    Scene scene;
    scene.m = static_cast<int>(size[0]);
    scene.n = static_cast<int>(size[1]);
    scene.bearings = ReadNumbers(in, scene.m * scene.n);
    scene.poses = ReadNumbers(in, 3 * scene.m);
    scene.landmarks = ReadNumbers(in, 2 * scene.n);
    ReadNumbers(in, 3 * scene.m + 2 * scene.n);  // the truth
    scenes.push_back(std::move(scene));
  }
  return scenes;
}

}  // namespace

int main(int argc, char** argv) {
  google::InitGoogleLogging(argv[0]);
  int repeat = 15;
  bool fixed_gauge = true;
  ceres::LinearSolverType solver = ceres::DENSE_SCHUR;
  const char* path = nullptr;
  for (int k = 1; k < argc; ++k) {
    const std::string word = argv[k], next = k + 1 < argc ? argv[k + 1] : "";
    if (word == "--repeat" && std::atoi(next.c_str()) > 0) {
      repeat = std::atoi(argv[++k]);
    } else if (word == "--gauge" && (next == "fixed" || next == "free")) {
      fixed_gauge = next == "fixed", ++k;
    } else if (word == "--solver" && next == "dense_schur") {
      solver = ceres::DENSE_SCHUR, ++k;
    } else if (word == "--solver" && next == "dense_normal") {
      solver = ceres::DENSE_NORMAL_CHOLESKY, ++k;
    } else if (word == "--solver" && next == "dense_qr") {
      solver = ceres::DENSE_QR, ++k;
    } else if (path == nullptr && word[0] != '-') {
      path = argv[k];
    } else {
      std::fprintf(stderr, "ceres_refine: cannot use '%s'\n", argv[k]);
      return 2;
    }
  }
  if (path == nullptr) {
    std::fprintf(stderr, "usage: ceres_refine FILE [--repeat N] [--solver NAME] [--gauge fixed|free]\n");
    return 2;
  }

  for (const Scene& start : ReadScenes(path)) {
    Scene now = start;
    ceres::Problem::Options problem_options;
    problem_options.disable_all_safety_checks = true;
    ceres::Problem problem(problem_options);
    auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (int i = 0; i < now.m; ++i) {
      problem.AddParameterBlock(&now.poses[3 * i], 3);
      ordering->AddElementToGroup(&now.poses[3 * i], 1);
    }
    for (int j = 0; j < now.n; ++j) {
      problem.AddParameterBlock(&now.landmarks[2 * j], 2);
      ordering->AddElementToGroup(&now.landmarks[2 * j], 0);
    }
    for (int i = 0; i < now.m; ++i) {
      for (int j = 0; j < now.n; ++j) {
        problem.AddResidualBlock(new Sighting(now.bearings[i * now.n + j]), nullptr, &now.poses[3 * i],
                                 &now.landmarks[2 * j]);
      }
    }
    // The first pose is held constant; the scale is left to the damping, which acts on every parameter anyway.
    if (fixed_gauge) problem.SetParameterBlockConstant(&now.poses[0]);

    ceres::Solver::Options options;
    options.linear_solver_type = solver;
    options.linear_solver_ordering = ordering;
    options.num_threads = 1;
    options.max_num_iterations = 100;
    options.function_tolerance = 1e-9;  // relative decrease of the cost, as in gtsam_refine.py
    options.gradient_tolerance = 1e-12;
    options.parameter_tolerance = 1e-10;
    options.logging_type = ceres::SILENT;

    std::vector<double> microseconds;
    ceres::Solver::Summary summary;
    for (int k = 0; k <= repeat; ++k) {
      std::copy(start.poses.begin(), start.poses.end(), now.poses.begin());
      std::copy(start.landmarks.begin(), start.landmarks.end(), now.landmarks.begin());
      const auto begin = std::chrono::steady_clock::now();
      ceres::Solve(options, &problem, &summary);
      const auto end = std::chrono::steady_clock::now();
      if (!summary.IsSolutionUsable()) {
        std::fprintf(stderr, "ceres_refine: %s\n", summary.message.c_str());
        return 1;
      }
      // The first run warms the caches.
      if (k > 0) microseconds.push_back(std::chrono::duration<double, std::micro>(end - begin).count());
    }

    double cost = 0.0;  // evaluated here, in the same way for every refiner
    for (int i = 0; i < now.m; ++i) {
      for (int j = 0; j < now.n; ++j) {
        const double dx = now.landmarks[2 * j] - now.poses[3 * i];
        const double dy = now.landmarks[2 * j + 1] - now.poses[3 * i + 1];
        const double r = Wrap(std::atan2(dy, dx) - now.poses[3 * i + 2] - now.bearings[i * now.n + j]);
        cost += r * r;
      }
    }
    std::sort(microseconds.begin(), microseconds.end());
    std::printf("%d %d %.3f %.3f %d %.12e\n", now.m, now.n, microseconds[repeat / 2], microseconds[0],
                static_cast<int>(summary.iterations.size()) - 1, cost);
  }
  return 0;
}
