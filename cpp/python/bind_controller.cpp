#include <nanobind/stl/variant.h>

#include "exclusive.hpp"
#include "robot_arguments.hpp"
#include "tick_output.hpp"
#include "topics.hpp"

namespace proxcgal::binding {
namespace {

using Bound = Exclusive<Controller>;

/// A call that only one thread makes at a time, readers included.
template <class Call>
auto alone(Call call) {
  return [call](Bound& controller) {
    const Turn<Controller> turn(controller, "Controller");
    return call(controller);
  };
}

Output tick(Bound& controller, double time, nb::handle q, const std::vector<Scan>& scans,
            nb::handle goal, bool late, std::optional<double> q_stamp) {
  // Values that are not finite are findings of the tick; only what is no array at all is an error.
  const Turn<Controller> turn(controller, "Controller");
  const JointVector joints = vector_from(q, "q", controller.robot().n_q(), Take::kExact, false);
  const Pose T_WT = pose_from(goal, "goal", Take::kExact, false);
  const nb::gil_scoped_release release;
  return kept(controller, controller.tick(time, joints, scans, T_WT, late, q_stamp));
}

/// `velocity_W` of `tick_known`: None, (3,) for all points, or (n, 3).
class VelocityRows {
 public:
  VelocityRows(nb::handle value, Eigen::Index points) : rows_(nullptr, 0, 3) {
    if (value.is_none()) return;
    view_ = array_from(value, "velocity_W", "(3,) or (n, 3) float64", Take::kConvert);
    if (view_.ndim() != 1) {
      require_shape(view_, "velocity_W", "(3,), or (n, 3) with a row for each point", {points, 3});
    } else {
      require_shape(view_, "velocity_W", "(3,), or (n, 3) with a row for each point", {3});
    }
    const auto rows = static_cast<Eigen::Index>(view_.ndim() == 1 ? 1 : view_.shape(0));
    new (&rows_) Eigen::Map<const Points>(view_.data(), rows, 3);
  }
  const Eigen::Map<const Points>& rows() const { return rows_; }

 private:
  ArrayView view_;
  Eigen::Map<const Points> rows_;
};

Output tick_known(Bound& controller, double time, nb::handle q, nb::handle points, nb::handle goal,
                  nb::handle velocity) {
  const Turn<Controller> turn(controller, "Controller");
  const JointVector joints = vector_from(q, "q", controller.robot().n_q(), Take::kExact, false);
  const Pose T_WT = pose_from(goal, "goal", Take::kExact, false);
  const ArrayView view = array_from(points, "points_W", "(n, 3) float64", Take::kExact);
  const auto points_W = points_view(view, "points_W");
  const VelocityRows velocities_W(velocity, points_W.rows());
  const nb::gil_scoped_release release;
  return kept(controller, controller.tick_known(time, joints, points_W, T_WT, velocities_W.rows()));
}

}  // namespace

void bind_controller(nb::module_& m) {
  nb::class_<Bound>(
      m, "Controller",
      "The tick: sense, filter, distance, task, solve, limit, under the monitor. One controller, "
      "one "
      "thread at a time: a call while another thread is in one raises ProxError, readers "
      "included.\n\n"
      "Raises:\n    ConfigError: a setting out of bounds.\n    ModelError: a sensor on an unknown "
      "link.")
      .def(
          "__init__",
          [](Bound* self, std::shared_ptr<Robot> robot, const Skin& skin,
             const ControllerConfig& config) { new (self) Bound(std::move(robot), skin, config); },
          "robot"_a, "skin"_a, "config"_a = ControllerConfig{})
      .def("tick", &tick, "time"_a, "q"_a, "scans"_a, "goal"_a, "late"_a = false,
           "q_stamp"_a = nb::none(),
           "One cycle from what the sensors sent.\n\n"
           "Args:\n    time: the caller's monotonic clock [s].\n    q: (n_q,) float64, measured "
           "[rad or m].\n"
           "    scans: those since the last tick, may be empty.\n    goal: (4, 4) float64, T_WT.\n "
           "   late: the caller missed its deadline.\n    q_stamp: when q was measured, on the "
           "same clock "
           "[s]; None: just now.\n\n"
           "Raises:\n    GeometryError: an array of the wrong shape or type. Bad values are "
           "findings, not errors.")
      .def(
          "tick_known", &tick_known, "time"_a, "q"_a, "points_W"_a, "goal"_a,
          "velocity_W"_a = nb::none(),
          "One cycle from points (n, 3) of the scene itself; `velocity_W` is theirs [m/s]: (n, 3), "
          "or (3,) for all.")
      .def("last_ticks", alone([](const Controller& c) { return last_ticks(c); }),
           "The last 64 ticks, the oldest first. After a STOP they stay as they were when it came, "
           "until `reset`.")
      .def("cloud_W", alone([](const Controller& c) { return Points(c.cloud_W()); }),
           "(n, 3) filtered cloud of the last tick, in world [m]: what the last scans show, then "
           "what is "
           "remembered.")
      .def_prop_ro("seen_points", alone([](const Controller& c) { return c.seen_points(); }),
                   "Rows of `cloud_W` that the last scans show.")
      .def(
          "cloud_ages",
          [](Bound& c, double time) {
            const Turn<Controller> turn(c, "Controller");
            return c.cloud_ages(time);
          },
          "time"_a, "[s] since each row of `cloud_W` was measured.")
      .def("cloud_origins", alone([](const Controller& c) {
             Eigen::Matrix<int, Eigen::Dynamic, 2, Eigen::RowMajor> rows(
                 static_cast<Eigen::Index>(c.cloud_origins().size()), 2);
             Eigen::Index i = 0;
             for (const PointOrigin& origin : c.cloud_origins())
               rows.row(i++) << origin.sensor, origin.zone;
             return rows;
           }),
           "(n, 2) sensor and zone of each point of the filtered cloud.")
      .def("raw_cloud_W", alone([](const Controller& c) { return Points(c.raw_cloud_W()); }),
           "(n, 3) before body removal, in world [m].")
      .def(
          "scan_ages",
          [](Bound& c, double time) {
            const Turn<Controller> turn(c, "Controller");
            return c.scan_ages(time);
          },
          "time"_a, "[s] since each sensor's last scan was received, inf where none came.")
      .def("accept_mounts", alone([](Controller& c) { c.accept_mounts(); }),
           "The mounts were checked: ends the HOLD that monitor.await_mounts begins with.")
      .def("reset", alone([](Controller& c) { return c.reset(); }),
           "Leaves STOP, only once its cause is gone; True where it did.")
      .def(
          "retune",
          [](Bound& c, const std::vector<TaskSpec>& tasks) {
            const Turn<Controller> turn(c, "Controller");
            c.retune(tasks);
          },
          "tasks"_a,
          "Other values for the same tasks in the same order, from the next tick on; what was "
          "seen and commanded, and the mode, stay.\n\n"
          "Raises:\n    ConfigError: other tasks or another order, a value out of bounds; nothing "
          "is changed then.")
      .def(
          "go_on_from",
          [](Bound& c, nb::handle qd) {
            const Turn<Controller> turn(c, "Controller");
            c.go_on_from(vector_from(qd, "qd", c.robot().n_q(), Take::kConvert));
          },
          "qd"_a,
          "Commands go on from this velocity (n_q,) [rad/s or m/s] instead of from rest: for a "
          "controller that takes over an arm that moves.\n\n"
          "Raises:\n    ConfigError: above a joint's speed limit.\n    GeometryError: an array of "
          "the wrong shape or type, or not finite.")
      .def_prop_ro(
          "robot", [](const Bound& c) -> const Robot& { return c.robot(); },
          nb::rv_policy::reference_internal, "That it was set up with.")
      .def_prop_ro(
          "skin", [](const Bound& c) { return c.skin(); }, "That it was set up with.")
      .def_prop_ro("config", alone([](const Controller& c) { return c.config(); }),
                   "That it was set up with; its tasks as `retune` left them.");
}

}  // namespace proxcgal::binding
