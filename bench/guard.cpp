// A fixed input for counting instructions: `./run bench --guard` runs it under callgrind, on the
// portable kernels, and holds the count against bench/guard.json.
//
//     bench_guard TICKS
#include <cstdio>
#include <cstdlib>

#include "../cpp/tests/robots.hpp"

int main(int argc, char** argv) {
  using namespace proxcgal;  // NOLINT(google-build-using-namespace)
  const int ticks = argc > 1 ? std::atoi(argv[1]) : 0;
  const auto robot = test::arm(6, 70, 140);
  const Skin skin = test::ring(30);
  ControllerConfig config;
  config.tasks = {JointLimits{}, Avoidance{}, MinimumAltitude{}, Reach{}};
  Controller controller(robot, skin, config);
  JointVector q(6);
  q << 0.2, 0.6, 0.9, 0.1, 0.5, 0.0;
  Posture posture = robot->make_posture();
  robot->update(q, posture);
  Pose goal = posture.T_WT;
  goal.translation().x() += 0.2;
  // Plain arithmetic, so that no library's random numbers decide what is counted.
  std::uint32_t random = 1;
  const auto uniform = [&](double low, double high) {
    random = random * 1664525U + 1013904223U;
    return low + (high - low) * (random >> 8) / double(1U << 24);
  };
  std::vector<Scan> scans(skin.mounts.size());
  double time = 0.0;
  for (int i = 0; i < ticks; ++i) {
    time += config.period;
    for (std::size_t s = 0; s < scans.size(); ++s) {
      scans[s].sensor = static_cast<int>(s);
      scans[s].counter = static_cast<std::uint32_t>(i);
      scans[s].stamp = time;
      scans[s].status.fill(5);
      // A wall that turns with the ticks, a little rough, as sensors see one.
      const double slope = uniform(-0.05, 0.05), wall = uniform(0.5, 0.9);
      for (int zone = 0; zone < kZones; ++zone)
        scans[s].ranges[static_cast<std::size_t>(zone)] =
            wall + slope * (zone % 8) + uniform(-0.01, 0.01);
    }
    q += config.period * controller.tick(time, q, scans, goal).qd;
  }
  std::printf("%.17g\n", q.sum());
  return 0;
}
