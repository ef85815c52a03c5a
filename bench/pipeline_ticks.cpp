#include "pipeline.hpp"

namespace proxcgal::bench {
namespace {

constexpr double kTickBudget = 150.0;    // [us]
constexpr double kMemoryBudget = 100.0;  // [us] more
constexpr double kJointBudget = 400.0;   // [us]
constexpr int kTicks = 5000;
constexpr double kSway = 0.05;  // [rad]

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

}  // namespace

void add_ticks(const Cell& cell) {
  if (cell.robot->n_q() == 12) {
    add_joint_ticks(cell);
    return;
  }
  add_tick(cell, "tick/scans", {Avoidance{}, Reach{}}, kTickBudget);
  add_tick(cell, "tick/five_tasks",
           {JointLimits{}, Avoidance{.nearest = 3}, MinimumAltitude{}, Manipulability{}, Reach{}},
           0.0);
  add_memory(cell, 1, 1);
  add_memory(cell, 1, 7);
  add_memory(cell, 100, 1);
  add_memory(cell, 100, 7);
}

}  // namespace proxcgal::bench
