#include "proxcgal/pipeline/command.hpp"
#include "proxcgal/pipeline/solve.hpp"
#include "stack_arguments.hpp"
#include "topics.hpp"

namespace proxcgal::binding {
namespace {

Admissible make_admissible(nb::handle q_min, nb::handle q_max, nb::handle qd_max,
                           nb::handle qdd_max, nb::handle q, nb::handle qd, double dt,
                           double speed_scale) {
  const JointVector posture = joints_from(q, "q");
  const Eigen::Index n = posture.size();
  const Limits limits{limits_from(q_min, "q_min", n, -kInfinity, ""),
                      limits_from(q_max, "q_max", n, -kInfinity, ""),
                      limits_from(qd_max, "qd_max", n, 0.0, "at least 0"),
                      limits_from(qdd_max, "qdd_max", n, 0.0, "at least 0")};
  require(std::isfinite(dt) && dt > 0.0, "dt", dt, "finite and above 0 s");
  require(speed_scale >= 0.0 && speed_scale <= 1.0, "speed_scale", speed_scale, "between 0 and 1");
  return admissible(limits, posture, vector_from(qd, "qd", n, Take::kConvert), dt, speed_scale);
}

Eigen::VectorXd command_from(const std::vector<Task>& tasks, const Solution& solution,
                             nb::handle qd_last, const Admissible& box) {
  const Eigen::Index n = solution.qd().size();
  require_joints(tasks, n);
  if (box.low.size() != n) {
    throw GeometryError("box has " + std::to_string(box.low.size()) + " joints, expected " +
                        std::to_string(n));
  }
  JointVector out;
  command({solution.rho.data(), static_cast<std::size_t>(solution.levels) + 1}, tasks,
          vector_from(qd_last, "qd_last", n, Take::kConvert), box, out);
  return out;
}

Eigen::VectorXd decelerated(nb::handle qd_last, const Admissible& box) {
  JointVector out;
  decelerate(vector_from(qd_last, "qd_last", box.low.size(), Take::kConvert), box, out);
  return out;
}

Eigen::VectorXd rate_kept(nb::handle row, double least, const Admissible& box, nb::handle qd) {
  const Eigen::Index n = box.low.size();
  JointVector out = vector_from(qd, "qd", n, Take::kConvert);
  keep_rate(vector_from(row, "row", n, Take::kConvert), least, box, out);
  return out;
}

}  // namespace

void bind_command(nb::module_& m) {
  nb::class_<Admissible>(m, "Admissible",
                         "Velocities that each joint may take in one tick [rad/s] or [m/s].")
      .def_prop_ro(
          "low", [](const Admissible& b) { return Eigen::VectorXd(b.low); }, "(n,)")
      .def_prop_ro(
          "high", [](const Admissible& b) { return Eigen::VectorXd(b.high); }, "(n,)")
      .def_prop_ro(
          "steady_low", [](const Admissible& b) { return Eigen::VectorXd(b.steady_low); },
          "(n,) without the acceleration limit, never above 0.")
      .def_prop_ro(
          "steady_high", [](const Admissible& b) { return Eigen::VectorXd(b.steady_high); },
          "(n,) without the acceleration limit, never below 0.");
  m.def("admissible", &make_admissible, "q_min"_a, "q_max"_a, "qd_max"_a, "qdd_max"_a, "q"_a,
        "qd"_a, "dt"_a, "speed_scale"_a = 1.0,
        "Position, velocity and acceleration limits of one tick, room to brake included.\n\n"
        "Args: limits (n,), infinite where there is none; q (n,) [rad] or [m]; qd (n,) the last "
        "command; dt [s]; speed_scale in [0, 1] of qd_max.\nRaises: GeometryError for a wrong "
        "shape or NaN, ConfigError for a negative limit, dt or scale.");
  m.def("command", &command_from, "tasks"_a, "solution"_a, "qd_last"_a, "box"_a,
        "The solution brought within limits, (n,): lower levels are shrunk first, then the whole "
        "is scaled; never one joint alone.\n\n"
        "Args: tasks as they were solved; qd_last (n,) the last command; box from admissible.");
  m.def("decelerate", &decelerated, "qd_last"_a, "box"_a,
        "From the last command straight towards rest as far as box allows, (n,).");
  m.def("keep_rate", &rate_kept, "row"_a, "least"_a, "box"_a, "qd"_a,
        "The velocity in box nearest to qd with row @ qd >= least, (n,); where there is none, the "
        "one with the most.");
}

}  // namespace proxcgal::binding
