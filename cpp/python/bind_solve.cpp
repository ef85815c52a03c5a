#include "bind_fields.hpp"
#include "proxcgal/pipeline/solve.hpp"
#include "stack_arguments.hpp"
#include "topics.hpp"

namespace proxcgal::binding {
namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

void require_at_most(std::size_t count, int limit, const std::string& what) {
  if (count <= static_cast<std::size_t>(limit)) return;
  throw ConfigError(std::to_string(count) + " " + what + ": at most " + std::to_string(limit) +
                    " are supported");
}

Task make_task(nb::handle jacobian, nb::handle rate, nb::handle activation) {
  const ArrayView view = array_from(jacobian, "jacobian", "(m, n) float64", Take::kConvert);
  require_shape(view, "jacobian", "(m, n)", {-1, -1});
  require_at_most(view.shape(0), kMaxRows, "rows of jacobian");
  require_at_most(view.shape(1), kMaxJoints, "columns of jacobian");
  const auto m = static_cast<Eigen::Index>(view.shape(0));
  const auto n = static_cast<Eigen::Index>(view.shape(1));
  if (n == 0) throw GeometryError("jacobian has no column, expected (m, n) with n joints");
  Task task;
  task.jacobian = Eigen::Map<const Matrix>(view.data(), m, n);
  if (!task.jacobian.allFinite()) throw GeometryError("jacobian is not finite");
  task.rate = vector_from(rate, "rate", m, Take::kConvert);
  const Eigen::VectorXd active = vector_from(activation, "activation", m, Take::kConvert);
  require_between(active, "activation", 0.0, 1.0, "between 0 and 1");
  task.activation = active;
  return task;
}

Solution solve_tasks(const std::vector<Task>& tasks, nb::handle qd_max,
                     const SolverConfig& config) {
  if (tasks.empty()) throw ConfigError("tasks is empty, at least one is needed");
  require_at_most(tasks.size(), kMaxLevels, "tasks");
  const Eigen::Index n = tasks.front().jacobian.cols();
  require_joints(tasks, n);
  validate(config);
  JointVector limit;
  if (!qd_max.is_none()) limit = limits_from(qd_max, "qd_max", n, 0.0, "at least 0");
  Solution out;
  solve(tasks, static_cast<int>(n), limit, config, out);
  return out;
}

std::vector<Eigen::VectorXd> levels_of(const Solution& solution) {
  return {solution.rho.begin(), solution.rho.begin() + solution.levels + 1};
}

}  // namespace

void bind_solve(nb::module_& m) {
  nb::class_<Task>(
      m, "Task",
      "One level of the stack: rates that its rows should have. Source: thesis eq. (4.8).")
      .def(
          "__init__",
          [](Task* self, nb::handle jacobian, nb::handle rate, nb::handle activation) {
            new (self) Task(make_task(jacobian, rate, activation));
          },
          "jacobian"_a, "rate"_a, "activation"_a,
          "Args: jacobian (m, n); rate (m,) of J qd; activation (m,), from 0 (free) to 1 "
          "(enforced).\nRaises: GeometryError for a wrong shape or what is not finite, ConfigError "
          "for an activation outside [0, 1] or more than 32 rows or joints.")
      .def_prop_ro(
          "jacobian", [](const Task& t) { return Matrix(t.jacobian); }, "(m, n)")
      .def_prop_ro(
          "rate", [](const Task& t) { return Eigen::VectorXd(t.rate); }, "(m,) of J qd.")
      .def_prop_ro(
          "activation", [](const Task& t) { return Eigen::VectorXd(t.activation); },
          "(m,) in [0, 1].");
  bind_fields<SolverConfig, Access::kReadWrite>(m);
  nb::class_<Solution>(m, "Solution", "Joint velocities after each level [rad/s] or [m/s].")
      .def_prop_ro(
          "qd", [](const Solution& s) { return Eigen::VectorXd(s.qd()); },
          "(n,) after the closing level: the answer.")
      .def_prop_ro("rho", &levels_of, "List of (n,): after each task, and after the closing level.")
      .def_ro("overflowed", &Solution::overflowed,
              "Levels left out because a number in them overflowed.");
  m.def("solve", &solve_tasks, "tasks"_a, "qd_max"_a = nb::none(), "config"_a = SolverConfig{},
        "The iCAT task-priority solver, the first task the most important; appends the closing "
        "level (J = A = I, rate 0).\n\n"
        "Args: tasks, at most 16, all of n joints; qd_max (n,) [rad/s] or [m/s], None for no "
        "saturation.\nRaises: GeometryError for columns or qd_max that do not fit, ConfigError for "
        "no or too many tasks and a negative qd_max.\nSource: thesis eqs. (4.7), (4.8).");
}

}  // namespace proxcgal::binding
