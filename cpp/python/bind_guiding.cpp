#include "bind_fields.hpp"
#include "proxcgal/guiding/hand_guide.hpp"
#include "robot_arguments.hpp"
#include "topics.hpp"

namespace proxcgal::binding {
namespace {

Vector6 vector6_from(nb::handle value, const char* name, Take take = Take::kConvert) {
  return vector_from(value, name, 6, take, false);
}

/// From the robot and the fields of the config.
template <std::size_t... kAt>
void bind_constructor(nb::class_<HandGuide>& guide, std::index_sequence<kAt...> all) {
  const std::vector<std::string> names = field_names<HandGuideConfig>();
  guide.def(
      "__init__",
      [all](HandGuide* self, std::shared_ptr<const Robot> robot,
            typename FieldAt<HandGuideConfig, kAt>::Parameter... values) {
        new (self) HandGuide(
            std::move(robot),
            config_from<HandGuideConfig>(
                all, false,
                std::forward<typename FieldAt<HandGuideConfig, kAt>::Parameter>(values)...));
      },
      "robot"_a, nb::kw_only(), FieldAt<HandGuideConfig, kAt>::argument(names)...,
      "Args: qd_max, qdd_max (n,) of the commands, None for the robot's own; period [s].\n"
      "Raises: ConfigError with field, value and what is allowed.");
}

}  // namespace

void bind_guiding(nb::module_& m) {
  bind_fields<AdmittanceConfig>(
      m,
      "Args: six numbers each, None for the defaults.\nRaises: ConfigError with field, value and "
      "what is allowed.");
  nb::class_<Admittance>(m, "Admittance",
                         "The tool as a mass in a viscous medium that the hand pushes; passive.")
      .def(nb::init<const AdmittanceConfig&>(), "config"_a = AdmittanceConfig{})
      .def(
          "step",
          [](Admittance& a, nb::handle force, bool engaged, double dt) {
            require(std::isfinite(dt) && dt > 0.0, "dt", dt, "finite and above 0 s");
            return Vector6(a.step(vector6_from(force, "force"), engaged, dt));
          },
          "force"_a, "engaged"_a, "dt"_a,
          "One cycle: the mean velocity over it (6,), linear first, in world.\n\n"
          "Args: force (6,) at the handle [N], [N m]; engaged, the hand's switch; dt [s].")
      .def(
          "held_to",
          [](Admittance& a, nb::handle achieved) { a.held_to(vector6_from(achieved, "achieved")); },
          "achieved"_a,
          "What became of the last step's velocity (6,): axes that were held back lose the energy.")
      .def_prop_ro(
          "velocity", [](const Admittance& a) { return Vector6(a.velocity()); },
          "(6,) at the end of the cycle.")
      .def_prop_ro("energy", &Admittance::energy, "[J] kinetic.")
      .def_prop_ro("engagement", &Admittance::engagement, "0 let go, 1 let in.");
  nb::class_<HandGuideOutput>(m, "HandGuideOutput", "What one cycle of hand guiding gave.")
      .def_prop_ro(
          "qd", [](const HandGuideOutput& o) { return Eigen::VectorXd(o.qd); },
          "(n,) admissible command.")
      .def_prop_ro(
          "wanted", [](const HandGuideOutput& o) { return Vector6(o.wanted); },
          "(6,) twist by the admittance.")
      .def_prop_ro(
          "achieved", [](const HandGuideOutput& o) { return Vector6(o.achieved); },
          "(6,) twist by the command.")
      .def_prop_ro(
          "T_WT", [](const HandGuideOutput& o) { return to_matrix(o.T_WT); }, "(4, 4)");
  nb::class_<HandGuide> guide(m, "HandGuide",
                              "From the force at the handle to joint velocities: admittance, "
                              "task-priority solver, limits.");
  register_table<HandGuideConfig>();
  bind_constructor(guide, EveryField<HandGuideConfig>{});
  guide
      .def(
          "step",
          [](HandGuide& g, nb::handle q, nb::handle force, bool engaged) -> const HandGuideOutput& {
            return g.step(vector_from(q, "q", g.robot().n_q(), Take::kExact),
                          vector6_from(force, "force", Take::kExact), engaged);
          },
          "q"_a, "force"_a, "engaged"_a, nb::rv_policy::reference_internal,
          "One cycle.\n\nArgs: q (n,) measured; force (6,) at the handle, in world [N], [N m]; "
          "engaged, the hand's switch.\nReturns: the output, reused: copy what you keep.")
      .def("halt", &HandGuide::halt, "The torque was cut: what follows starts at rest.");
}

}  // namespace proxcgal::binding
