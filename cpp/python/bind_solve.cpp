#include <nanobind/stl/pair.h>

#include "convert.hpp"
#include "proxcgal/pipeline/command.hpp"
#include "proxcgal/pipeline/solve.hpp"
#include "proxcgal/pipeline/task.hpp"

namespace proxcgal::binding {
namespace {

constexpr std::pair<const char*, Damping> kDampings[] = {{"literal", Damping::kLiteral},
                                                         {"code", Damping::kCode}};

Task task_from(nb::handle jacobian, nb::handle rate, nb::handle activation) {
  const ArrayView J = array_from(jacobian, "jacobian", "(m, n) float64", Take::kConvert);
  require_shape(J, "jacobian", "(m, n)", {-1, -1});
  const auto m = static_cast<std::int64_t>(J.shape(0)), n = static_cast<std::int64_t>(J.shape(1));
  if (m > kMaxRows || n > kMaxJoints) {
    throw ConfigError("jacobian has shape " + shape_of(J) + ": at most " +
                      std::to_string(kMaxRows) + " rows and " + std::to_string(kMaxJoints) +
                      " joints are supported");
  }
  Task task;
  task.jacobian =
      Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
          J.data(), m, n);
  if (!task.jacobian.allFinite()) throw GeometryError("jacobian is not finite");
  task.rate = vector_from(rate, "rate", m, Take::kConvert);
  task.activation = vector_from(activation, "activation", m, Take::kConvert);
  if ((task.activation.array() < 0.0).any() || (task.activation.array() > 1.0).any()) {
    throw ConfigError("activation must lie in [0, 1]");
  }
  return task;
}

Solution solve_stack(const std::vector<Task>& tasks, nb::handle qd_max,
                     const SolverConfig& config) {
  if (tasks.empty()) throw ConfigError("tasks is empty, at least one is needed");
  if (tasks.size() > kMaxLevels) {
    throw ConfigError(std::to_string(tasks.size()) + " tasks, at most " +
                      std::to_string(kMaxLevels) + " are supported");
  }
  const Eigen::Index n = tasks.front().jacobian.cols();
  for (const Task& task : tasks) {
    if (task.jacobian.cols() != n) {
      throw GeometryError("jacobian has " + std::to_string(task.jacobian.cols()) +
                          " columns in one task and " + std::to_string(n) + " in the first");
    }
  }
  JointVector limit;
  if (!qd_max.is_none()) {
    limit = vector_from(qd_max, "qd_max", n, Take::kConvert);
    if ((limit.array() < 0.0).any()) throw ConfigError("qd_max must be 0 or more");
  }
  Solution out;
  solve(tasks, static_cast<int>(n), limit, config, out);
  return out;
}

}  // namespace
}  // namespace proxcgal::binding

void bind_solve(nanobind::module_& m) {
  using namespace proxcgal;           // NOLINT(google-build-using-namespace)
  using namespace proxcgal::binding;  // NOLINT(google-build-using-namespace)
  nb::class_<Task>(m, "Task", "Rates that J qd should have, row by row.")
      .def(
          "__init__",
          [](Task* self, nb::handle jacobian, nb::handle rate, nb::handle activation) {
            new (self) Task(task_from(jacobian, rate, activation));
          },
          "jacobian"_a, "rate"_a, "activation"_a)
      .def_prop_ro("jacobian", [](const Task& t) { return Eigen::MatrixXd(t.jacobian); })
      .def_prop_ro("rate", [](const Task& t) { return Eigen::VectorXd(t.rate); })
      .def_prop_ro("activation", [](const Task& t) { return Eigen::VectorXd(t.activation); });
  nb::class_<SolverConfig>(m, "SolverConfig", "Constants of the regularised pseudo-inverse.")
      .def(
          "__init__",
          [](SolverConfig* self, double damping, double damping_threshold, double eta,
             const std::string& form) {
            const SolverConfig config{damping, damping_threshold, eta,
                                      choice(form, "form", kDampings)};
            config.validate();
            new (self) SolverConfig(config);
          },
          nb::kw_only(), "damping"_a = SolverConfig{}.damping,
          "damping_threshold"_a = SolverConfig{}.damping_threshold, "eta"_a = SolverConfig{}.eta,
          "form"_a = "literal")
      .def_ro("damping", &SolverConfig::damping)
      .def_ro("damping_threshold", &SolverConfig::damping_threshold)
      .def_ro("eta", &SolverConfig::eta)
      .def_prop_ro("form", [](const SolverConfig& c) { return choice_name(c.form, kDampings); });
  nb::class_<Solution>(m, "Solution", "Joint velocities after each level; the last is the answer.")
      .def_prop_ro("qd", [](const Solution& s) { return Eigen::VectorXd(s.qd()); })
      .def_prop_ro("rho", [](const Solution& s) {
        std::vector<Eigen::VectorXd> rho;
        for (int k = 0; k <= s.levels; ++k) rho.emplace_back(s.rho[static_cast<std::size_t>(k)]);
        return rho;
      });
  m.def("solve", &solve_stack, "tasks"_a, "qd_max"_a = nb::none(), "config"_a = SolverConfig{},
        "The iCAT task-priority solver; appends the closing level.");
  const auto checked = [](auto* self, auto spec) {
    spec.validate();
    new (self) decltype(spec)(spec);
  };
  nb::class_<Avoidance>(m, "Avoidance", "Keep the robot away from the nearest obstacle.")
      .def(
          "__init__",
          [checked](Avoidance* self, double d_min, double buffer, double gain, int nearest) {
            checked(self, Avoidance{d_min, buffer, gain, nearest});
          },
          nb::kw_only(), "d_min"_a = Avoidance{}.d_min, "buffer"_a = Avoidance{}.buffer,
          "gain"_a = Avoidance{}.gain, "nearest"_a = Avoidance{}.nearest)
      .def_ro("d_min", &Avoidance::d_min)
      .def_ro("buffer", &Avoidance::buffer)
      .def_ro("gain", &Avoidance::gain)
      .def_ro("nearest", &Avoidance::nearest);
  nb::class_<Reach>(m, "Reach", "Bring the tool to the goal.")
      .def(
          "__init__",
          [checked](Reach* self, double gain, double max_linear, double max_angular) {
            checked(self, Reach{gain, max_linear, max_angular});
          },
          nb::kw_only(), "gain"_a = Reach{}.gain, "max_linear"_a = Reach{}.max_linear,
          "max_angular"_a = Reach{}.max_angular)
      .def_ro("gain", &Reach::gain)
      .def_ro("max_linear", &Reach::max_linear)
      .def_ro("max_angular", &Reach::max_angular);
  nb::class_<JointLimits>(m, "JointLimits", "Keep every joint off its position limits.")
      .def(
          "__init__",
          [checked](JointLimits* self, double gain, double margin) {
            checked(self, JointLimits{gain, margin});
          },
          nb::kw_only(), "gain"_a = JointLimits{}.gain, "margin"_a = JointLimits{}.margin)
      .def_ro("gain", &JointLimits::gain)
      .def_ro("margin", &JointLimits::margin);
  nb::class_<MinimumAltitude>(m, "MinimumAltitude", "Keep the tool above a height.")
      .def(
          "__init__",
          [checked](MinimumAltitude* self, double height, double buffer, double gain) {
            checked(self, MinimumAltitude{height, buffer, gain});
          },
          nb::kw_only(), "height"_a = MinimumAltitude{}.height,
          "buffer"_a = MinimumAltitude{}.buffer, "gain"_a = MinimumAltitude{}.gain)
      .def_ro("height", &MinimumAltitude::height)
      .def_ro("buffer", &MinimumAltitude::buffer)
      .def_ro("gain", &MinimumAltitude::gain);
  nb::class_<Manipulability>(m, "Manipulability", "Keep one arm's manipulability up.")
      .def(
          "__init__",
          [checked](Manipulability* self, double target, double low, double high, double gain,
                    int first_joint, int joints) {
            checked(self, Manipulability{target, low, high, gain, first_joint, joints});
          },
          nb::kw_only(), "target"_a = Manipulability{}.target, "low"_a = Manipulability{}.low,
          "high"_a = Manipulability{}.high, "gain"_a = Manipulability{}.gain, "first_joint"_a = 0,
          "joints"_a = 0)
      .def_ro("target", &Manipulability::target)
      .def_ro("low", &Manipulability::low)
      .def_ro("high", &Manipulability::high)
      .def_ro("gain", &Manipulability::gain)
      .def_ro("first_joint", &Manipulability::first_joint)
      .def_ro("joints", &Manipulability::joints);
}
