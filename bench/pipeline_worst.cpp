#include <random>

#include "pipeline.hpp"
#include "proxcgal/pipeline/distance.hpp"

namespace proxcgal::bench {
namespace {

constexpr double kLargeBudget = 5000.0;  // [us]

/// As many points as asked for, of several clouds: what more sensors would see, each a little off.
Points many(const Points& points, Eigen::Index n) {
  std::mt19937_64 engine(0);
  std::normal_distribution<double> noise(0.0, 0.01);
  Points out(n, 3);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (int k = 0; k < 3; ++k)
      out(i, k) = points(i % points.rows(), k) + (i < points.rows() ? 0.0 : noise(engine));
  }
  return out;
}

void add_large(const Cell& cell) {
  for (const int n : {1920, 19'200, 192'000}) {
    const auto points = std::make_shared<Points>(many(cell.environment_W, n));
    add(named("distance/many", cell, n), n == 192'000 ? 200 : 1000,
        [&cell, points, n](benchmark::State& state) {
          Samples samples;
          for (auto _ : state) {
            samples.take(state, [&] {
              benchmark::DoNotOptimize(
                  closest_pair(*cell.robot, cell.posture, *points, Method::kFast));
            });
          }
          samples.report(state, n == 192'000 ? kLargeBudget : 0.0);
        });
  }
}

/// Points at the middle of a link, from where its surface is about equally far all round.
void add_adversarial(const Cell& cell) {
  for (const int n : {1920, 192'000}) {
    std::mt19937_64 engine(0);
    std::normal_distribution<double> noise(0.0, 1e-4);
    const auto points = std::make_shared<Points>(n, 3);
    const int link = cell.robot->n_links() / 2;
    const Vector3 center_W =
        cell.posture.T_WL[static_cast<std::size_t>(link)] * cell.robot->tree(link).bounds().center;
    for (int i = 0; i < n; ++i) {
      for (int k = 0; k < 3; ++k) (*points)(i, k) = center_W[k] + noise(engine);
    }
    add(named("distance/inside", cell, n), 50, [&cell, points](benchmark::State& state) {
      Samples samples;
      ClosestPair pair;
      for (auto _ : state) {
        samples.take(state, [&] {
          std::int64_t steps = kSearchSteps;
          pair = closest_pair(*cell.robot, cell.posture, *points, Method::kFast, {.steps = &steps});
        });
      }
      samples.report(state, kWorstBudget);
      state.counters["lower_bound"] = pair.lower_bound ? 1 : 0;
    });
  }
}

/// Clusters in the middle of every link, in no order, and three links avoided: the worst tick.
void add_worst_tick(const Cell& cell) {
  for (const int nearest : {1, 3}) {
    add("tick/inside_all_links/" + cell.name + "/nearest=" + std::to_string(nearest), 20,
        [&cell, nearest](benchmark::State& state) {
          constexpr int n = 192'000;
          std::mt19937_64 engine(0);
          std::normal_distribution<double> noise(0.0, 1e-4);
          Points points(n, 3);
          for (int i = 0; i < n; ++i) {
            const int link = static_cast<int>(engine() % unsigned(cell.robot->n_links()));
            const Vector3 center_W = cell.posture.T_WL[static_cast<std::size_t>(link)] *
                                     cell.robot->tree(link).bounds().center;
            for (int k = 0; k < 3; ++k) points(i, k) = center_W[k] + noise(engine);
          }
          ControllerConfig config;
          config.tasks = {Avoidance{.nearest = nearest}, Reach{}};
          Controller controller(cell.robot, Skin{}, config);
          double time = 0.0;
          Samples samples;
          for (auto _ : state) {
            time += config.period;
            samples.take(state, [&] {
              benchmark::DoNotOptimize(
                  controller.tick_known(time, cell.posture.q, points, cell.goal));
            });
          }
          samples.report(state, kWorstBudget);
        });
  }
}

}  // namespace

void add_worst(const Cell& cell) {
  add_large(cell);
  add_adversarial(cell);
  add_worst_tick(cell);
}

/// The centre of a sphere of 10^4 vertices: no part of the surface can be left out.
void add_sphere() {
  for (const int n : {1920, 192'000}) {
    add("distance/sphere_centre/vertices=9940/points=" + std::to_string(n), 20,
        [n](benchmark::State& state) {
          constexpr int rings = 71, segments = 140;
          RobotSpec spec;
          spec.name = "ball";
          spec.joints = {{.name = "joint", .qd_max = 1.0, .qdd_max = 1.0}};
          LinkSpec link{.name = "ball", .joint = 0};
          link.vertices_L.resize((rings + 1) * segments, 3);
          link.triangles.resize(2 * rings * segments, 3);
          for (int i = 0, f = 0; i <= rings; ++i) {
            for (int j = 0; j < segments; ++j) {
              const double theta = M_PI * i / rings, phi = 2 * M_PI * j / segments;
              link.vertices_L.row(i * segments + j) << 0.2 * std::sin(theta) * std::cos(phi),
                  0.2 * std::sin(theta) * std::sin(phi), 0.2 * std::cos(theta);
              if (i == rings) continue;
              const int a = i * segments + j, b = i * segments + (j + 1) % segments;
              link.triangles.row(f++) << a, a + segments, b;
              link.triangles.row(f++) << b, a + segments, b + segments;
            }
          }
          spec.links = {link};
          const Robot robot(std::move(spec));
          const Posture posture = robot.make_posture();
          std::mt19937_64 engine(0);
          std::uniform_real_distribution<double> noise(-1e-3, 1e-3);
          Points points(n, 3);
          for (double& x : points.reshaped()) x = noise(engine);
          Samples samples;
          ClosestPair pair;
          for (auto _ : state) {
            samples.take(state, [&] {
              std::int64_t steps = kSearchSteps;
              pair = closest_pair(robot, posture, points, Method::kFast, {.steps = &steps});
            });
          }
          samples.report(state, kWorstBudget);
          state.counters["lower_bound"] = pair.lower_bound ? 1 : 0;
          state.counters["distance_m"] = pair.distance;
        });
  }
}

}  // namespace proxcgal::bench
