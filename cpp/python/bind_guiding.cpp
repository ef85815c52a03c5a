#include "proxcgal/guiding/hand_guide.hpp"
#include "robot_arguments.hpp"
#include "topics.hpp"

namespace proxcgal::binding {
namespace {

Vector6 vector6_from(nb::handle value, const char* name, Take take = Take::kConvert) {
  return vector_from(value, name, 6, take, false);
}

}  // namespace

void bind_guiding(nb::module_& m) {
  const AdmittanceConfig fresh;
  nb::class_<AdmittanceConfig>(m, "AdmittanceConfig",
                               "M a + D v = F: three linear and three angular axes, in world.")
      .def(
          "__init__",
          [](AdmittanceConfig* self, nb::handle mass, nb::handle damping, nb::handle dead_band,
             nb::handle max_force, double engage_time) {
            AdmittanceConfig config;
            const auto take = [](nb::handle value, const char* name, Vector6& field) {
              if (!value.is_none()) field = vector6_from(value, name);
            };
            take(mass, "mass", config.mass);
            take(damping, "damping", config.damping);
            take(dead_band, "dead_band", config.dead_band);
            take(max_force, "max_force", config.max_force);
            config.engage_time = engage_time;
            config.validate();
            new (self) AdmittanceConfig(config);
          },
          nb::kw_only(), "mass"_a = nb::none(), "damping"_a = nb::none(),
          "dead_band"_a = nb::none(), "max_force"_a = nb::none(),
          "engage_time"_a = fresh.engage_time,
          "Args: six numbers each, None for the defaults.\nRaises: ConfigError with field, value "
          "and bound.")
      .def_prop_ro(
          "mass", [](const AdmittanceConfig& c) { return Vector6(c.mass); }, "(6,) [kg], [kg m^2]")
      .def_prop_ro(
          "damping", [](const AdmittanceConfig& c) { return Vector6(c.damping); },
          "(6,) [N s/m], [N m s/rad]")
      .def_prop_ro(
          "dead_band", [](const AdmittanceConfig& c) { return Vector6(c.dead_band); },
          "(6,) [N], [N m]")
      .def_prop_ro(
          "max_force", [](const AdmittanceConfig& c) { return Vector6(c.max_force); },
          "(6,) [N], [N m]")
      .def_ro("engage_time", &AdmittanceConfig::engage_time, "[s]");
  nb::class_<Admittance>(m, "Admittance",
                         "The tool as a mass in a viscous medium that the hand pushes; passive.")
      .def(nb::init<const AdmittanceConfig&>(), "config"_a = fresh)
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
  nb::class_<HandGuide>(m, "HandGuide",
                        "From the force at the handle to joint velocities: admittance, "
                        "task-priority solver, limits.")
      .def(
          "__init__",
          [](HandGuide* self, std::shared_ptr<const Robot> robot,
             const AdmittanceConfig& admittance, const SolverConfig& solver, nb::handle qd_max,
             nb::handle qdd_max, double period) {
            new (self) HandGuide(std::move(robot),
                                 {admittance, solver, joints_from(qd_max, "qd_max", false),
                                  joints_from(qdd_max, "qdd_max", false), period});
          },
          "robot"_a, nb::kw_only(), "admittance"_a = fresh, "solver"_a = SolverConfig{},
          "qd_max"_a = nb::none(), "qdd_max"_a = nb::none(), "period"_a = HandGuideConfig{}.period,
          "Args: qd_max, qdd_max (n,) of the commands, None for the robot's own; period [s].\n"
          "Raises: ConfigError with field, value and bound.")
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
