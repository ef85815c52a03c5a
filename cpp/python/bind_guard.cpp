#include <nanobind/stl/pair.h>

#include <utility>

#include "bind_fields.hpp"
#include "proxcgal/safety/guard.hpp"
#include "robot_arguments.hpp"
#include "topics.hpp"

namespace proxcgal::binding {
namespace {

using Pairs = std::vector<std::pair<std::string, std::string>>;

double separation_needed(const IsoSeparation& iso, double robot_speed, double stop_time) {
  const auto usable = [](double value) { return std::isfinite(value) && value >= 0.0; };
  require(usable(robot_speed), "robot_speed", robot_speed, "finite, 0 m/s or more");
  require(usable(stop_time), "stop_time", stop_time, "finite, 0 s or more");
  return protective_distance(iso, robot_speed, stop_time);
}

Pairs pairs_of(const std::vector<Contradiction>& found) {
  Pairs pairs;
  for (const Contradiction& each : found) pairs.emplace_back(each.item, each.text);
  return pairs;
}

std::vector<std::string> violated(const SafetyOutput& out) {
  std::vector<std::string> names;
  for (int f = 0; f < kSafetyFunctions; ++f)
    if ((out.violated >> static_cast<unsigned>(f) & 1U) != 0)
      names.emplace_back(function_name(static_cast<SafetyFunction>(f)));
  return names;
}

const GuardOutput& cycle(Guard& guard, double time, nb::handle q, nb::handle qd, bool reset,
                         nb::handle human_velocity) {
  const int n = guard.robot().n_q();
  Vector3 human_W = Vector3::Zero();
  if (!human_velocity.is_none())
    human_W = vector_from(human_velocity, "human_velocity_W", 3, Take::kExact, false);
  return guard.cycle(time, vector_from(q, "q", n, Take::kExact, false),
                     vector_from(qd, "qd", n, Take::kExact, false), reset, human_W);
}

}  // namespace

void bind_guard(nb::module_& m) {
  nb::class_<LinkCapsule>(m, "LinkCapsule", "The capsule of one link, in the link's frame.")
      .def(
          "__init__",
          [](LinkCapsule* self, std::string name, int link, const Capsule& shape_L) {
            new (self) LinkCapsule{std::move(name), link, shape_L};
          },
          "name"_a, "link"_a, "shape_L"_a,
          "Args: name, for messages and lists; link, a row of link_names; shape_L.")
      .def_ro("name", &LinkCapsule::name, "For messages and lists.")
      .def_ro("link", &LinkCapsule::link, "Row of link_names.")
      .def_ro("shape_L", &LinkCapsule::shape_L, "In the link's frame.");
  bind_fields<IsoSeparation>(m);
  m.def("protective_distance", &separation_needed, "iso"_a, "robot_speed"_a, "stop_time"_a,
        "Separation distance of ISO/TS 15066 [m] for constant speeds [m/s] and constant "
        "deceleration over the stopping time [s].");
  bind_fields<GuardConfig, Access::kReadOnly, 0, Validated::kByItsUser>(
      m,
      "Args: q_reference, qd_max, qdd_max (n,); human_offset (3,); None for the defaults.\n"
      "Raises: GeometryError for a wrong shape or what is not finite; `Guard` checks the rest.");
  m.def(
      "guard_contradictions",
      [](const Robot& robot, const GuardConfig& config) {
        return pairs_of(contradictions(robot, config));
      },
      "robot"_a, "config"_a,
      "What contradicts what: (item as `accept` names it, a sentence with the numbers).");
  nb::class_<Trip>(m, "Trip", "Why the torque was cut.")
      .def_prop_ro("function", [](const Trip& t) { return function_name(t.function); })
      .def_ro("time", &Trip::time, "[s]")
      .def_ro("value", &Trip::value, "What was found.")
      .def_ro("limit", &Trip::limit, "What is allowed.")
      .def_ro("row", &Trip::row, "Joint or capsule concerned, -1 for none.");
  nb::class_<GuardOutput>(m, "GuardOutput", "What one cycle of the guard found.")
      .def_prop_ro(
          "torque", [](const GuardOutput& o) { return o.safety.torque; },
          "The STO signal: may the motors have torque?")
      .def_prop_ro(
          "state", [](const GuardOutput& o) { return std::string(choice_name(o.safety.state)); },
          "'off', 'on', 'stopping'.")
      .def_prop_ro(
          "violated", [](const GuardOutput& o) { return violated(o.safety); },
          "Names of the functions that are violated in this cycle.")
      .def_prop_ro(
          "trip", [](const GuardOutput& o) { return o.safety.trip; }, "Of the last stop.")
      .def_prop_ro(
          "trips", [](const GuardOutput& o) { return o.safety.trips; }, "How many, so far.")
      .def_prop_ro(
          "stop_time", [](const GuardOutput& o) { return o.safety.stop_time; },
          "[s] since the torque was cut, until rest.")
      .def_prop_ro(
          "overrun", [](const GuardOutput& o) { return o.safety.overrun; },
          "Not at rest in the declared time, or moved under its brakes: no reset any more.")
      .def_prop_ro(
          "reset_refused", [](const GuardOutput& o) { return o.safety.reset_refused; },
          "The button went down in this cycle, for nothing.")
      .def_prop_ro(
          "speed_ratio", [](const GuardOutput& o) { return o.safety.speed_ratio; },
          "Largest |qd| / qd_UB.")
      .def_prop_ro(
          "acceleration_ratio", [](const GuardOutput& o) { return o.safety.acceleration_ratio; },
          "Largest |qdd| / qdd_UB.")
      .def_ro("tcp_speed", &GuardOutput::tcp_speed, "[m/s]")
      .def_prop_ro(
          "distance", [](const GuardOutput& o) { return o.separation.distance; },
          "[m] least over the monitored pairs.")
      .def_prop_ro(
          "velocity", [](const GuardOutput& o) { return o.separation.velocity; },
          "[m/s] relative, most over the links' ends, positive towards the operator.")
      .def_prop_ro(
          "protective_distance",
          [](const GuardOutput& o) { return o.separation.protective_distance; },
          "[m] ISO/TS 15066 at the relative velocity of this cycle.");
  nb::class_<Guard>(m, "Guard",
                    "Guard of walk-through programming, one call a cycle. Source: [WT] eqs. (1) "
                    "to (4), Fig. 5.")
      .def(nb::init<std::shared_ptr<const Robot>, GuardConfig>(), "robot"_a, "config"_a,
           "Raises: ConfigError: settings out of bounds; contradictions that `accept` does not "
           "name, one line each; names in `accept` where nothing is to be accepted.")
      .def("cycle", &cycle, "time"_a, "q"_a, "qd"_a, "reset"_a = false,
           "human_velocity_W"_a = nb::none(), nb::rv_policy::reference_internal,
           "One cycle.\n\nArgs: time [s], the caller's monotonic clock; q, qd (n,) float64; "
           "reset, the button: what counts is that it goes down; human_velocity_W (3,) [m/s].\n"
           "Returns: the output, reused: copy what you keep.")
      .def_prop_ro(
          "qd_bounds", [](const Guard& g) { return Eigen::VectorXd(g.limits().qd); },
          "(n,) [rad/s] of eq. (1).")
      .def_prop_ro(
          "qdd_bounds", [](const Guard& g) { return Eigen::VectorXd(g.limits().qdd); },
          "(n,) [rad/s^2] of eq. (2).")
      .def_prop_ro("config", &Guard::config, "That it was set up with.")
      .def_prop_ro(
          "accepted", [](const Guard& g) { return pairs_of(g.accepted()); },
          "Contradictions that are taken as they are: to be printed and logged.")
      .def_prop_ro(
          "monitored_pairs",
          [](const Guard& g) {
            std::vector<std::string> names;
            for (const int row : g.separation().pairs())
              names.push_back(g.separation().capsules()[static_cast<std::size_t>(row)].name);
            return names;
          },
          "Capsules whose distance to the operator counts: to be printed at the start.")
      .def_prop_ro(
          "monitored_ends",
          [](const Guard& g) {
            std::vector<std::string> names;
            for (const int row : g.separation().ends())
              names.push_back(g.separation().capsules()[static_cast<std::size_t>(row)].name);
            return names;
          },
          "Capsules whose far ends' velocity counts.")
      .def_prop_ro("protective_distance", &Guard::protective_distance,
                   "[m] ISO/TS 15066 at tcp_speed, beside min_distance.");
}

}  // namespace proxcgal::binding
