#include <chrono>

#include "pipeline.hpp"
#include "proxcgal/pipeline/distance.hpp"
#include "proxcgal/pipeline/limit.hpp"

namespace proxcgal::bench {
namespace {

void add_perceiving(const Cell& cell) {
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
    Limiter limiter(limits, LimitConfig::papers(), 0.01);
    Samples samples;
    for (auto _ : state) {
      samples.take(state, [&] {
        build_avoidance(Avoidance{}, robot, cell.posture, std::span(&control, 1), built[0]);
        build_reach(Reach{}, robot, cell.posture, cell.goal, built[1]);
        for (std::size_t i = 0; i < 2; ++i) stack[i] = built[i].task;
        solve(stack, robot.n_q(), limits.qd_max, SolverConfig{}, solution);
        limiter.begin(cell.posture.q, rest, 0.01);
        qd = limiter.limit({.nominal = solution.qd(), .tasks = stack}).qd;
      });
      benchmark::DoNotOptimize(qd);
    }
    samples.report(state);
  });
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

void add_stages(const Cell& cell) {
  add_perceiving(cell);
  add_solving(cell);
  add_loading(cell);
}

}  // namespace proxcgal::bench
