// One cycle of walk-through programming: the guard on seven capsules, and hand guiding.
#include "../cpp/tests/guards.hpp"
#include "proxcgal/guiding/hand_guide.hpp"
#include "samples.hpp"

namespace proxcgal {
namespace {

constexpr int kCycles = 200000;
constexpr double kPeriod = 0.001;

/// Postures of a slow wander, so that no two cycles are alike.
JointVector wander(int cycle, double rate) {
  JointVector q(6);
  for (int k = 0; k < 6; ++k) q[k] = 0.6 * std::sin(rate * cycle * kPeriod * (k + 1) + k);
  return q;
}

void guard_cycle(benchmark::State& state) {
  const auto robot = test::arm();
  GuardConfig config = test::guard_config(*robot);
  config.separation.pairs = {};  // all of them: the most there is to do
  for (const Contradiction& each : contradictions(*robot, config))
    config.accept.push_back(each.item);
  Guard guard(robot, config);
  bench::Samples samples;
  int cycle = 0;
  JointVector last = wander(0, 0.05);
  for (auto _ : state) {
    const JointVector q = wander(++cycle, 0.05);
    const JointVector qd = (q - last) / kPeriod;
    last = q;
    samples.take(state, [&] { guard.cycle(cycle * kPeriod, q, qd, cycle % 100 == 0); });
  }
  samples.report(state, 20.0);
}

void hand_guide_step(benchmark::State& state) {
  const auto robot = test::arm();
  HandGuide guide(robot, {});
  bench::Samples samples;
  JointVector q = JointVector::Constant(6, 0.5);
  int cycle = 0;
  for (auto _ : state) {
    Vector6 force = Vector6::Zero();
    force.head<3>() = 20.0 * wander(++cycle, 1.0).head<3>();
    samples.take(state, [&] { guide.step(q, force, true); });
    q += kPeriod * guide.output().qd;
  }
  samples.report(state);
}

BENCHMARK(guard_cycle)->Name("guard/cycle/capsules=7")->UseManualTime()->Iterations(kCycles);
BENCHMARK(hand_guide_step)->Name("hand_guide/step")->UseManualTime()->Iterations(kCycles);

}  // namespace
}  // namespace proxcgal

BENCHMARK_MAIN();
