#include <nanobind/stl/map.h>
#include <nanobind/stl/pair.h>

#include <algorithm>

#include "convert.hpp"
#include "limit_names.hpp"
#include "tick_output.hpp"
#include "topics.hpp"

namespace proxcgal::binding {
namespace {

std::string link_name(const Robot& robot, int link) {
  return link < 0 ? "" : robot.spec().links[static_cast<std::size_t>(link)].name;
}

std::string joint_name(const Robot& robot, int joint) {
  return joint < 0 ? "" : robot.spec().joints[static_cast<std::size_t>(joint)].name;
}

/// Of some findings `link` is a joint.
bool names_joint(Reason reason) {
  return reason == Reason::kNotFollowing || reason == Reason::kJointStateUnits;
}

NamedFinding named_finding(const Robot& robot, const Finding& finding) {
  if (finding.link < 0) return {finding, std::nullopt};
  return {finding, names_joint(finding.reason) ? joint_name(robot, finding.link)
                                               : link_name(robot, finding.link)};
}

}  // namespace

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
  copy.nominal_qd = out.nominal_qd;
  copy.qd = out.qd;
  for (const ActiveLimit& row : out.limited) {
    const bool joint = row.kind == LimitKind::kJoint;
    copy.limited.push_back({row, joint ? joint_name(robot, row.link) : link_name(robot, row.link)});
  }
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

void bind_output(nb::module_& m) {
  nb::enum_<Mode>(m, "Mode", "How freely the arm may move. Faults only move right.")
      .value("RUN", Mode::kRun)
      .value("DEGRADED", Mode::kDegraded)
      .value("HOLD", Mode::kHold)
      .value("STOP", Mode::kStop);
  nb::class_<NamedFinding>(m, "Finding", "One thing the monitor found in this tick.")
      .def_prop_ro(
          "reason", [](const NamedFinding& f) { return reason_name(f.finding.reason); },
          "What was found, by its name in docs/conventions.md.")
      .def_prop_ro(
          "mode", [](const NamedFinding& f) { return mode_of(f.finding.reason); },
          "The mode it calls for.")
      .def_prop_ro(
          "sensor", [](const NamedFinding& f) { return f.finding.sensor; },
          "-1 where none is concerned.")
      .def_prop_ro(
          "zone", [](const NamedFinding& f) { return f.finding.zone; },
          "-1 where none is concerned.")
      .def_ro("link", &NamedFinding::link,
              "Name of the link concerned, or of the joint; None for none.")
      .def_prop_ro(
          "age", [](const NamedFinding& f) { return f.finding.age; }, "[s] of the data concerned.")
      .def_prop_ro(
          "count", [](const NamedFinding& f) { return f.finding.count; },
          "How many of them in this tick.")
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
      .def_prop_ro(
          "mode", [](const NamedRecord& r) { return r.record.mode; }, "That the tick ended in.")
      .def_prop_ro(
          "q", [](const NamedRecord& r) { return Eigen::VectorXd(r.record.q); }, "(n_q,) measured.")
      .def_prop_ro(
          "qd", [](const NamedRecord& r) { return Eigen::VectorXd(r.record.qd); },
          "(n_q,) commanded.")
      .def_prop_ro(
          "distance", [](const NamedRecord& r) { return r.record.distance; },
          "[m] of the pair, inf for none.")
      .def_ro("link", &NamedRecord::link, "Of the pair; empty for none.")
      .def_prop_ro(
          "sensor", [](const NamedRecord& r) { return r.record.origin.sensor; },
          "That saw the pair's obstacle point, -1 for none.")
      .def_prop_ro(
          "zone", [](const NamedRecord& r) { return r.record.origin.zone; },
          "Its zone, -1 for none.")
      .def_ro("findings", &NamedRecord::findings, "The first eight.");
  nb::class_<NamedLimit>(m, "ActiveLimit", "A row of the limit stage that changed the command.")
      .def_prop_ro(
          "kind", [](const NamedLimit& l) { return kind_name(l.row.kind); },
          "'joint', 'approach', 'own_approach', 'floor', 'unknown', 'retreat' or 'own_retreat'.")
      .def_ro("link", &NamedLimit::link, "Name of the link; of the joint where kind is 'joint'.")
      .def_prop_ro(
          "distance", [](const NamedLimit& l) { return l.row.distance; },
          "[m] that the row reckons with; inf for a joint and for 'unknown'.")
      .def_prop_ro(
          "rate", [](const NamedLimit& l) { return l.row.rate; },
          "[m/s] at which the command opens that distance; the joint's velocity.")
      .def("__repr__", [](const NamedLimit& l) {
        return std::string("ActiveLimit(kind='") + kind_name(l.row.kind) + "', link='" + l.link +
               "', distance=" + std::to_string(l.row.distance) +
               ", rate=" + std::to_string(l.row.rate) + ")";
      });
  nb::class_<Report>(m, "TaskReport", "What one task wanted and got in this tick, row by row.")
      .def_ro("name", &Report::name, "Of the task.")
      .def_ro("rate", &Report::rate, "(m,) reference rate.")
      .def_ro("activation", &Report::activation, "(m,) in [0, 1].")
      .def_ro("residual", &Report::residual, "(m,) rate - J qd.");
  nb::class_<Output>(m, "TickOutput", "Everything one tick tells.")
      .def_ro("nominal_qd", &Output::nominal_qd, "(n_q,) what the solver asked for [rad/s or m/s].")
      .def_ro("qd", &Output::qd, "(n_q,) admissible joint velocity: what is sent [rad/s or m/s].")
      .def_ro("limited", &Output::limited,
              "Rows of the limit stage that made `qd` another than `nominal_qd`.")
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
      .def_ro("mode", &Output::mode, "How freely the arm may move.")
      .def_ro("findings", &Output::findings, "What the monitor found in this tick.")
      .def_ro("tasks", &Output::tasks, "One report a task, in order of priority.")
      .def_ro("timings", &Output::timings, "[us] per stage, empty unless switched on.");
}

}  // namespace proxcgal::binding
