#include <nanobind/stl/map.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/variant.h>

#include <limits>
#include <map>

#include "named_pair.hpp"
#include "proxcgal/controller.hpp"
#include "robot_arguments.hpp"

namespace proxcgal::binding {
namespace {

/// A finding that tells its link by name.
struct NamedFinding {
  Finding finding;
  std::optional<std::string> link;
};

/// A kept tick whose findings tell their links by name.
struct NamedRecord {
  TickRecord record;
  std::string link;
  std::vector<NamedFinding> findings;
};

struct Report {
  std::string name;
  Eigen::VectorXd rate, activation, residual;
};

/// A tick's output that a user may keep: the core's own is reused.
struct Output {
  Eigen::VectorXd qd;
  std::optional<NamedPair> pair;
  PointOrigin origin;
  double pair_age = 0.0;
  bool pair_remembered = false;
  Vector3 obstacle_velocity_W = Vector3::Zero();
  std::optional<Vector3> control_W;
  double control_distance = kInfinity;
  std::string control_link;
  std::optional<std::pair<std::string, std::string>> own_links;
  double own_distance = kInfinity;
  double trusted_distance = kInfinity;
  Mode mode;
  std::vector<NamedFinding> findings;
  std::vector<Report> tasks;
  std::map<std::string, double> timings;
};

std::string link_name(const Robot& robot, int link) {
  return link < 0 ? "" : robot.spec().links[static_cast<std::size_t>(link)].name;
}

NamedFinding named_finding(const Robot& robot, const Finding& finding) {
  return {finding, finding.link < 0 ? std::nullopt : std::optional(link_name(robot, finding.link))};
}

std::vector<NamedRecord> last_ticks(const Controller& controller) {
  std::vector<NamedRecord> out;
  for (const TickRecord& record : controller.last_ticks()) {
    NamedRecord next{record, link_name(controller.robot(), record.link), {}};
    const auto n =
        std::min<std::size_t>(static_cast<std::size_t>(record.n_findings), record.findings.size());
    for (std::size_t i = 0; i < n; ++i)
      next.findings.push_back(named_finding(controller.robot(), record.findings[i]));
    out.push_back(std::move(next));
  }
  return out;
}

Output kept(const Controller& controller, const TickOutput& out) {
  const Robot& robot = controller.robot();
  Output copy;
  copy.qd = out.qd;
  if (out.pair) copy.pair = named(robot, *out.pair);
  copy.origin = out.pair_origin;
  copy.pair_age = out.pair_age;
  copy.pair_remembered = out.pair_remembered;
  copy.obstacle_velocity_W = out.obstacle_velocity_W;
  if (out.control.link >= 0) copy.control_W = out.control.control_W;
  copy.control_distance = out.control.distance;
  copy.control_link = link_name(robot, out.control.link);
  copy.trusted_distance = out.trusted_distance;
  if (out.own.a >= 0) {
    copy.own_links.emplace(link_name(robot, out.own.a), link_name(robot, out.own.b));
    copy.own_distance = out.own.distance;
  }
  copy.mode = out.mode;
  for (const Finding& finding : controller.findings()) {
    copy.findings.push_back(named_finding(robot, finding));
  }
  for (int i = 0; i < out.n_tasks; ++i) {
    const TaskReport& task = out.tasks[static_cast<std::size_t>(i)];
    copy.tasks.push_back({task.name, task.rate, task.activation, task.residual});
  }
  if (controller.config().timings) {
    copy.timings = {{"sense_us", out.timings.sense_us},   {"filter_us", out.timings.filter_us},
                    {"memory_us", out.timings.memory_us}, {"distance_us", out.timings.distance_us},
                    {"solve_us", out.timings.solve_us},   {"total_us", out.timings.total_us}};
  }
  return copy;
}

Output tick(Controller& controller, double time, nb::handle q, const std::vector<Scan>& scans,
            nb::handle goal, bool late, std::optional<double> q_stamp) {
  // Values that are not finite are findings of the tick; only what is no array at all is an error.
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

Output tick_known(Controller& controller, double time, nb::handle q, nb::handle points,
                  nb::handle goal, nb::handle velocity) {
  const JointVector joints = vector_from(q, "q", controller.robot().n_q(), Take::kExact, false);
  const Pose T_WT = pose_from(goal, "goal", Take::kExact, false);
  const ArrayView view =
      array_from(points, "points_W", "C-contiguous (n, 3) float64", Take::kExact);
  const auto points_W = points_view(view, "points_W");
  const VelocityRows velocities_W(velocity, points_W.rows());
  const nb::gil_scoped_release release;
  return kept(controller, controller.tick_known(time, joints, points_W, T_WT, velocities_W.rows()));
}

Scan scan_from(int sensor, std::uint32_t counter, double stamp, nb::handle ranges,
               nb::handle status) {
  Scan scan;
  scan.sensor = sensor;
  scan.counter = counter;
  scan.stamp = stamp;
  const Eigen::VectorXd values = vector_from(ranges, "ranges", kZones, Take::kConvert, false);
  std::copy(values.begin(), values.end(), scan.ranges.begin());
  nb::ndarray<const std::uint8_t, nb::c_contig, nb::device::cpu> codes;
  if (!nb::try_cast(status, codes, false) || codes.ndim() != 1 || codes.shape(0) != kZones) {
    throw GeometryError("status must be a (64,) uint8 array: one target status code for each zone");
  }
  std::copy(codes.data(), codes.data() + kZones, scan.status.begin());
  return scan;
}

void bind_output(nb::module_& m) {
  nb::enum_<Mode>(m, "Mode", "How freely the arm may move. Faults only move right.")
      .value("RUN", Mode::kRun)
      .value("DEGRADED", Mode::kDegraded)
      .value("HOLD", Mode::kHold)
      .value("STOP", Mode::kStop);
  nb::class_<Scan>(m, "Scan", "One sensor's packet, as a VL53L8CX board sends it.")
      .def(
          "__init__",
          [](Scan* self, int sensor, std::uint32_t counter, double stamp, nb::handle ranges,
             nb::handle status) {
            new (self) Scan(scan_from(sensor, counter, stamp, ranges, status));
          },
          "sensor"_a, "counter"_a, "stamp"_a, "ranges"_a, "status"_a)
      .def_ro("sensor", &Scan::sensor, "Row of the skin.")
      .def_ro("counter", &Scan::counter, "Advances with every measurement.")
      .def_ro("stamp", &Scan::stamp, "[s] when it was measured, on the caller's clock.")
      .def_prop_ro(
          "ranges",
          [](const Scan& s) {
            return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(s.ranges.data(), kZones));
          },
          "(64,) [m] along the sensor's z axis.")
      .def_prop_ro(
          "status",
          [](const Scan& s) {
            return Eigen::Matrix<std::uint8_t, Eigen::Dynamic, 1>(
                Eigen::Map<const Eigen::Matrix<std::uint8_t, Eigen::Dynamic, 1>>(s.status.data(),
                                                                                 kZones));
          },
          "(64,) target status, 5 is valid.");
  nb::class_<NamedFinding>(m, "Finding", "One thing the monitor found in this tick.")
      .def_prop_ro("reason", [](const NamedFinding& f) { return reason_name(f.finding.reason); })
      .def_prop_ro(
          "mode", [](const NamedFinding& f) { return mode_of(f.finding.reason); },
          "The mode it calls for.")
      .def_prop_ro(
          "sensor", [](const NamedFinding& f) { return f.finding.sensor; },
          "-1 where none is concerned.")
      .def_prop_ro(
          "zone", [](const NamedFinding& f) { return f.finding.zone; },
          "-1 where none is concerned.")
      .def_ro("link", &NamedFinding::link)
      .def_prop_ro(
          "age", [](const NamedFinding& f) { return f.finding.age; }, "[s] of the data concerned.")
      .def_prop_ro("count", [](const NamedFinding& f) { return f.finding.count; })
      .def("__repr__", [](const NamedFinding& f) {
        std::string text = std::string("Finding(") + reason_name(f.finding.reason);
        if (f.finding.sensor >= 0) text += ", sensor=" + std::to_string(f.finding.sensor);
        if (f.finding.zone >= 0) text += ", zone=" + std::to_string(f.finding.zone);
        if (f.link) text += ", link='" + *f.link + "'";
        return text + ", age=" + std::to_string(f.finding.age) +
               ", count=" + std::to_string(f.finding.count) + ")";
      });
  nb::class_<NamedRecord>(m, "TickRecord", "What is kept of one tick.")
      .def_prop_ro(
          "time", [](const NamedRecord& r) { return r.record.time; }, "[s] the caller's.")
      .def_prop_ro("mode", [](const NamedRecord& r) { return r.record.mode; })
      .def_prop_ro(
          "q", [](const NamedRecord& r) { return Eigen::VectorXd(r.record.q); }, "(n_q,) measured.")
      .def_prop_ro(
          "qd", [](const NamedRecord& r) { return Eigen::VectorXd(r.record.qd); },
          "(n_q,) commanded.")
      .def_prop_ro(
          "distance", [](const NamedRecord& r) { return r.record.distance; },
          "[m] of the pair, inf for none.")
      .def_ro("link", &NamedRecord::link, "Of the pair; empty for none.")
      .def_prop_ro("sensor", [](const NamedRecord& r) { return r.record.origin.sensor; })
      .def_prop_ro("zone", [](const NamedRecord& r) { return r.record.origin.zone; })
      .def_ro("findings", &NamedRecord::findings, "The first eight.");
  nb::class_<Report>(m, "TaskReport", "What one task wanted and got in this tick, row by row.")
      .def_ro("name", &Report::name)
      .def_ro("rate", &Report::rate, "(m,) reference rate.")
      .def_ro("activation", &Report::activation, "(m,) in [0, 1].")
      .def_ro("residual", &Report::residual, "(m,) rate - J qd.");
  nb::class_<Output>(m, "TickOutput", "Everything one tick tells.")
      .def_ro("qd", &Output::qd, "(n_q,) admissible joint velocity [rad/s or m/s].")
      .def_ro("pair", &Output::pair,
              "Nearest of the links that joints can move away; None when nothing is in view.")
      .def_prop_ro(
          "pair_sensor", [](const Output& o) { return o.origin.sensor; },
          "Sensor that saw the pair's obstacle point, -1 for none.")
      .def_prop_ro(
          "pair_zone", [](const Output& o) { return o.origin.zone; }, "Its zone, -1 for none.")
      .def_ro("pair_age", &Output::pair_age, "[s] since that point was measured, 0 for none.")
      .def_ro("pair_remembered", &Output::pair_remembered, "No current scan shows it any more.")
      .def_ro("obstacle_velocity_W", &Output::obstacle_velocity_W,
              "(3,) of the pair's obstacle [m/s], as estimated (`tick`) or given (`tick_known`).")
      .def_ro("control_W", &Output::control_W,
              "(3,) point of the robot that avoidance moves, or None [m].")
      .def_ro("control_distance", &Output::control_distance,
              "[m] from that point to the obstacle; inf for none.")
      .def_ro("control_link", &Output::control_link, "Its link; empty for none.")
      .def_ro("own_links", &Output::own_links,
              "The two links that the first self-collision row parts; None where none is near.")
      .def_ro("own_distance", &Output::own_distance, "[m] between them; inf for none.")
      .def_ro("trusted_distance", &Output::trusted_distance,
              "[m] the pair's, less the way that something may have come since its scan was fresh; "
              "negative where the obstacle is inside the surface; inf for none.")
      .def_ro("mode", &Output::mode)
      .def_ro("findings", &Output::findings)
      .def_ro("tasks", &Output::tasks, "One report a task, in order of priority.")
      .def_ro("timings", &Output::timings, "[us] per stage, empty unless switched on.");
}

}  // namespace
}  // namespace proxcgal::binding

void bind_controller(nanobind::module_& m) {
  using namespace proxcgal;           // NOLINT(google-build-using-namespace)
  using namespace proxcgal::binding;  // NOLINT(google-build-using-namespace)
  bind_output(m);
  nb::class_<Controller>(
      m, "Controller",
      "The tick: sense, filter, distance, task, solve, command, under the monitor.\n\n"
      "Raises:\n    ConfigError: a setting out of bounds.\n    ModelError: a sensor on an unknown "
      "link.")
      .def(
          "__init__",
          [](Controller* self, std::shared_ptr<Robot> robot, const Skin& skin,
             const ControllerConfig& config) {
            new (self) Controller(std::move(robot), skin, config);
          },
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
      .def("last_ticks", &last_ticks,
           "The last 64 ticks, the oldest first. After a STOP they stay as they were when it came, "
           "until `reset`.")
      .def(
          "cloud_W", [](const Controller& c) { return Points(c.cloud_W()); },
          "(n, 3) filtered cloud of the last tick, in world [m]: what the last scans show, then "
          "what is "
          "remembered.")
      .def_prop_ro("seen_points", &Controller::seen_points,
                   "Rows of `cloud_W` that the last scans show.")
      .def("cloud_ages", &Controller::cloud_ages, "time"_a,
           "[s] since each row of `cloud_W` was measured.")
      .def(
          "cloud_origins",
          [](const Controller& c) {
            Eigen::Matrix<int, Eigen::Dynamic, 2, Eigen::RowMajor> rows(
                static_cast<Eigen::Index>(c.cloud_origins().size()), 2);
            Eigen::Index i = 0;
            for (const PointOrigin& origin : c.cloud_origins())
              rows.row(i++) << origin.sensor, origin.zone;
            return rows;
          },
          "(n, 2) sensor and zone of each point of the filtered cloud.")
      .def(
          "raw_cloud_W", [](const Controller& c) { return Points(c.raw_cloud_W()); },
          "(n, 3) before body removal, in world [m].")
      .def("scan_ages", &Controller::scan_ages, "time"_a,
           "[s] since each sensor's last scan was received, inf where none came.")
      .def("accept_mounts", &Controller::accept_mounts,
           "The mounts were checked: ends the HOLD that monitor.await_mounts begins with.")
      .def("reset", &Controller::reset,
           "Leaves STOP, only once its cause is gone; True where it did.")
      .def("retune", &Controller::retune, "tasks"_a,
           "Other values for the same tasks in the same order, from the next tick on; what was "
           "seen and commanded, and the mode, stay.\n\n"
           "Raises:\n    ConfigError: other tasks or another order, a value out of bounds; nothing "
           "is changed then.")
      .def_prop_ro(
          "robot", [](const Controller& c) -> const Robot& { return c.robot(); },
          nb::rv_policy::reference_internal)
      .def_prop_ro("skin", [](const Controller& c) { return c.skin(); })
      .def_prop_ro("config", [](const Controller& c) { return c.config(); });
}
