// Every stage and the whole tick on the cells that inputs.py wrote:
//
//     bench_pipeline CELL.bin ... [--benchmark_filter=tick] [--benchmark_out=FILE]
//
// Cells with one scan of each sensor are for the stages, cells with many for the ticks.
// Names tell stage, question, robot, resolution and size: tick/scans/ur10e_10000_raw/points=1580.
#include <chrono>
#include <cstdio>
#include <cstring>
#include <random>

#include "cell.hpp"
#include "samples.hpp"

namespace proxcgal::bench {
namespace {

constexpr double kTickBudget = 150.0, kLargeBudget = 5000.0, kWorstBudget = 66'700.0;  // [us]
constexpr double kMemoryBudget = 100.0;                                                // [us] more
constexpr double kJointBudget = 400.0;                                                 // [us]
constexpr int kTicks = 5000;
constexpr double kSway = 0.05;  // [rad]

std::string named(const char* what, const Cell& cell, Eigen::Index points) {
  return std::string(what) + '/' + cell.name + "/points=" + std::to_string(points);
}

template <class Run>
void add(const std::string& name, int iterations, Run run) {
  benchmark::RegisterBenchmark(name.c_str(), run)
      ->UseManualTime()
      ->Iterations(iterations)
      ->Unit(benchmark::kMicrosecond);
}

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

void add_stages(const Cell& cell) {
  add(named("sense/points", cell, static_cast<Eigen::Index>(cell.skin.mounts.size()) * kZones),
      2000, [&cell](benchmark::State& state) {
        const Sense sense(cell.skin.model);
        SensedPoints out;
        Samples samples;
        for (auto _ : state) {
          samples.take(state, [&] {
            for (std::size_t s = 0; s < cell.skin.mounts.size(); ++s) {
              sense(cell.scans[s], out);
              benchmark::DoNotOptimize(out);
            }
          });
        }
        samples.report(state);
      });
  for (const Method method : {Method::kFast, Method::kPaper}) {
    const bool fast = method == Method::kFast;
    add(named(fast ? "filter/algorithm1" : "filter/algorithm1_paper", cell, cell.points_W.rows()),
        fast ? 2000 : 5, [&cell, method](benchmark::State& state) {
          const std::size_t n = cell.tolerance.size();
          const auto keep = std::make_unique<bool[]>(n);
          // The literal form's trees are built at the first question.
          remove_body(*cell.robot, cell.posture, cell.origins_W, cell.points_W, cell.tolerance,
                      cell.min_hit, method, {keep.get(), n});
          Samples samples;
          for (auto _ : state) {
            std::fill_n(keep.get(), n, true);
            samples.take(state, [&] {
              remove_body(*cell.robot, cell.posture, cell.origins_W, cell.points_W, cell.tolerance,
                          cell.min_hit, method, {keep.get(), n});
            });
          }
          if (!std::equal(keep.get(), keep.get() + n, cell.kept.begin()))
            state.SkipWithError("another mask than the literal algorithm's");
          samples.report(state);
        });
    add(named(fast ? "distance/closest" : "distance/closest_paper", cell,
              cell.environment_W.rows()),
        fast ? 2000 : 5, [&cell, method](benchmark::State& state) {
          Samples samples;
          ClosestPair pair;
          for (auto _ : state) {
            samples.take(state, [&] {
              pair = closest_pair(*cell.robot, cell.posture, cell.environment_W, method);
            });
          }
          if (!(std::abs(pair.distance - cell.distance) < 1e-9))
            state.SkipWithError("another distance than the literal algorithm's");
          samples.report(state);
        });
  }
  add(named("filter/surface_margin", cell, cell.points_W.rows()), 2000,
      [&cell](benchmark::State& state) {
        const std::size_t n = cell.tolerance.size();
        const auto keep = std::make_unique<bool[]>(n);
        Samples samples;
        for (auto _ : state) {
          std::fill_n(keep.get(), n, true);
          samples.take(state, [&] {
            remove_near_surface(*cell.robot, cell.posture, cell.points_W, cell.tolerance,
                                {keep.get(), n});
          });
        }
        samples.report(state);
      });
  add(named("distance/per_link", cell, cell.environment_W.rows()), 1000,
      [&cell](benchmark::State& state) {
        std::vector<ClosestPair> pairs(static_cast<std::size_t>(cell.robot->n_links()));
        Samples samples;
        for (auto _ : state) {
          samples.take(state, [&] {
            closest_pairs(*cell.robot, cell.posture, cell.environment_W, {}, pairs);
          });
        }
        samples.report(state);
      });
}

/// Each tick gets a new scan of every sensor, with noise of its own, while the arm sways: the most
/// that there can be to do.
void add_tick(const Cell& cell, const char* name, const std::vector<TaskSpec>& tasks,
              double budget_us) {
  const std::size_t sensors = cell.skin.mounts.size();
  add(named(name, cell, static_cast<Eigen::Index>(sensors) * kZones), kTicks,
      [&cell, tasks, sensors, budget_us](benchmark::State& state) {
        ControllerConfig config;
        config.tasks = tasks;
        Controller controller(cell.robot, cell.skin, config);
        std::vector<Scan> scans = cell.scans;
        JointVector q = cell.posture.q;
        double time = 0.0;
        std::uint32_t counter = 0;
        std::size_t batch = 0;
        Samples samples;
        for (auto _ : state) {
          time += config.period;
          ++counter;
          batch = (batch + sensors) % scans.size();
          for (std::size_t s = batch; s < batch + sensors; ++s) {
            scans[s].counter = counter;
            scans[s].stamp = time;
          }
          for (Eigen::Index j = 0; j < q.size(); ++j)
            q[j] = cell.posture.q[j] + kSway * std::sin(2.0 * time + static_cast<double>(j));
          samples.take(state, [&] {
            benchmark::DoNotOptimize(
                controller.tick(time, q, std::span(scans).subspan(batch, sensors), cell.goal));
          });
        }
        samples.report(state, budget_us);
        state.counters["cloud"] = static_cast<double>(controller.cloud_W().rows());
      });
}

/// The same ticks with memory and motion, beside a controller without. With new scans at every tick
/// 384 000 points come in within the 2 s that are remembered.
/// @param copies  of every sensor, at the same place: 100 bring 192 000 points in one tick
/// @param every   so many ticks a new scan of every sensor: 7 is 14 Hz
void add_memory(const Cell& cell, std::size_t copies, std::uint32_t every) {
  const std::size_t sensors = cell.skin.mounts.size(), all = sensors * copies;
  add(named(every > 1 ? "tick/memory_14hz" : "tick/memory", cell,
            static_cast<Eigen::Index>(all) * kZones),
      copies > 1 ? 140 : kTicks, [&cell, sensors, copies, every, all](benchmark::State& state) {
        Skin skin{.mounts = {}, .model = cell.skin.model};
        for (std::size_t s = 0; s < all; ++s) skin.mounts.push_back(cell.skin.mounts[s % sensors]);
        ControllerConfig config;
        Controller plain(cell.robot, skin, config);
        config.memory = MemoryConfig{};
        config.motion = MotionConfig{};
        Controller remembering(cell.robot, skin, config);
        std::vector<Scan> batch(all);
        JointVector q = cell.posture.q;
        const std::size_t batches = cell.scans.size() / sensors;
        std::size_t turn = 0;
        double time = 0.0;
        std::uint32_t counter = 0;
        Samples without, with;
        std::size_t remembered = 0;
        for (auto _ : state) {
          time += config.period;
          ++counter;
          for (std::size_t s = 0; s < all; ++s) {
            const std::size_t from = (turn + s / sensors) % batches;
            batch[s] = cell.scans[from * sensors + s % sensors];
            batch[s].sensor = static_cast<int>(s);
            batch[s].counter = counter;
            batch[s].stamp = time;
          }
          turn = (turn + copies) % batches;
          for (Eigen::Index j = 0; j < q.size(); ++j)
            q[j] = cell.posture.q[j] + kSway * std::sin(2.0 * time + static_cast<double>(j));
          const std::span<const Scan> fresh =
              counter % every == 0 ? std::span<const Scan>(batch) : std::span<const Scan>();
          without.take(state,
                       [&] { benchmark::DoNotOptimize(plain.tick(time, q, fresh, cell.goal)); });
          with.take(state,
                    [&] { benchmark::DoNotOptimize(remembering.tick(time, q, fresh, cell.goal)); });
          remembered +=
              static_cast<std::size_t>(remembering.cloud_W().rows() - remembering.seen_points());
        }
        without.report(state);
        const double before = state.counters["median_us"];
        with.report(state);
        state.counters["more_us"] = state.counters["median_us"] - before;
        state.counters["more_budget_us"] = kMemoryBudget;
        state.counters["remembered"] = static_cast<double>(remembered) / counter;
      });
}

/// The cylinder of the scene `joint_cylinder`, points 20 mm apart.
Points cylinder() {
  constexpr int kRound = 32, kUp = 76;
  Points points_W(kRound * kUp, 3);
  for (int i = 0; i < kRound * kUp; ++i) {
    const double angle = 2.0 * M_PI * (i % kRound) / kRound;
    points_W.row(i) << 2.6 + 0.1 * std::cos(angle), 0.25 + 0.1 * std::sin(angle),
        0.02 * (i / kRound);  // NOLINT(bugprone-integer-division)
  }
  return points_W;
}

/// The same on points of the scene itself.
void add_known_tick(const Cell& cell, const char* name, const std::vector<TaskSpec>& tasks,
                    double budget_us) {
  const Points points_W = cylinder();
  add(named(name, cell, points_W.rows()), kTicks,
      [&cell, tasks, points_W, budget_us](benchmark::State& state) {
        ControllerConfig config;
        config.tasks = tasks;
        Controller controller(cell.robot, cell.skin, config);
        JointVector q = cell.posture.q;
        double time = 0.0;
        Samples samples;
        for (auto _ : state) {
          time += config.period;
          for (Eigen::Index j = 0; j < q.size(); ++j)
            q[j] = cell.posture.q[j] + kSway * std::sin(2.0 * time + static_cast<double>(j));
          samples.take(state, [&] {
            benchmark::DoNotOptimize(controller.tick_known(time, q, points_W, cell.goal));
          });
        }
        samples.report(state, budget_us);
      });
}

/// The 12-joint robot's full stack: five levels with the closing one, six with self-collision.
void add_joint_ticks(const Cell& cell) {
  const Avoidance avoidance{.d_min = 0.05, .buffer = 0.15, .nearest = 3};
  const std::vector<TaskSpec> full = {JointLimits{}, avoidance, MinimumAltitude{}, Reach{}};
  const std::vector<TaskSpec> more = {JointLimits{}, SelfCollision{}, avoidance, MinimumAltitude{},
                                      Reach{}};
  add_tick(cell, "tick/joint_full", full, kJointBudget);
  add_tick(cell, "tick/joint_self_collision", more, kJointBudget);
  add_known_tick(cell, "tick/joint_full_known", full, kJointBudget);
  add_known_tick(cell, "tick/joint_self_collision_known", more, kJointBudget);
}

/// Task rows, solver and command, from the pair on.
void add_solving(const Cell& cell) {
  add("solve/avoid_and_reach/" + cell.name, 2000, [&cell](benchmark::State& state) {
    const Robot& robot = *cell.robot;
    const ClosestPair pair = closest_pair(robot, cell.posture, cell.environment_W, Method::kFast);
    ControlPair control;
    control.link = robot.n_links() - 1;
    control.control_W = pair.surface_W;
    control.obstacle_W = pair.obstacle_W;
    control.distance = 0.25;
    const Limits limits{robot.q_min(), robot.q_max(), robot.qd_max(), robot.qdd_max()};
    const JointVector rest = JointVector::Zero(robot.n_q());
    std::array<BuiltTask, 2> built;
    std::array<Task, 2> stack;
    Solution solution;
    JointVector qd = rest;
    Samples samples;
    for (auto _ : state) {
      samples.take(state, [&] {
        build_avoidance(Avoidance{}, robot, cell.posture, std::span(&control, 1), built[0]);
        build_reach(Reach{}, robot, cell.posture, cell.goal, built[1]);
        for (std::size_t i = 0; i < 2; ++i) stack[i] = built[i].task;
        solve(stack, robot.n_q(), limits.qd_max, SolverConfig{}, solution);
        const Admissible box = admissible(limits, cell.posture.q, rest, 0.01);
        command({solution.rho.data(), 3}, stack, rest, box, qd);
      });
      benchmark::DoNotOptimize(qd);
    }
    samples.report(state);
  });
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

void add_loading(const Cell& cell) {
  add("load/trees/" + cell.name, 10, [&cell](benchmark::State& state) {
    std::vector<double> ms;
    for (auto _ : state) {
      const auto begin = std::chrono::steady_clock::now();
      const Robot robot(cell.robot->spec());
      const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
      state.SetIterationTime(took.count());
      ms.push_back(1e3 * took.count());
    }
    std::sort(ms.begin(), ms.end());
    state.counters["median_ms"] = ms[ms.size() / 2];  // wall: links are built side by side
    state.counters["budget_ms"] = 80.0;
  });
}

}  // namespace
}  // namespace proxcgal::bench

int main(int argc, char** argv) {
  using namespace proxcgal;         // NOLINT(google-build-using-namespace)
  using namespace proxcgal::bench;  // NOLINT(google-build-using-namespace)
  std::vector<Cell> cells;
  std::vector<char*> rest;
  for (int i = 0; i < argc; ++i) {
    const bool is_cell = i > 0 && std::strstr(argv[i], ".bin") != nullptr && argv[i][0] != '-';
    if (!is_cell) {
      rest.push_back(argv[i]);
      continue;
    }
    try {
      cells.push_back(read_cell(argv[i]));
    } catch (const std::exception& error) {
      std::fprintf(stderr, "bench_pipeline: %s\n", error.what());
      return 2;
    }
  }
  if (cells.empty()) {
    std::fputs("bench_pipeline CELL.bin ...: no cell; bench/inputs.py writes them\n", stderr);
    return 2;
  }
  for (const Cell& cell : cells) {
    if (cell.scans.size() > cell.skin.mounts.size()) {  // many scans: for the ticks
      if (cell.robot->n_q() == 12) {
        add_joint_ticks(cell);
        continue;
      }
      add_tick(cell, "tick/scans", {Avoidance{}, Reach{}}, kTickBudget);
      add_tick(
          cell, "tick/five_tasks",
          {JointLimits{}, Avoidance{.nearest = 3}, MinimumAltitude{}, Manipulability{}, Reach{}},
          0.0);
      add_memory(cell, 1, 1);
      add_memory(cell, 1, 7);
      add_memory(cell, 100, 1);
      add_memory(cell, 100, 7);
      continue;
    }
    add_stages(cell);
    add_large(cell);
    add_solving(cell);
    add_adversarial(cell);
    add_worst_tick(cell);
    add_loading(cell);
  }
  add_sphere();
  int left = static_cast<int>(rest.size());
  benchmark::Initialize(&left, rest.data());
  if (benchmark::ReportUnrecognizedArguments(left, rest.data())) return 2;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
