#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <set>

#include "proxcgal/control/controller_config.hpp"
#include "proxcgal/fields.hpp"
#include "proxcgal/guiding/hand_guide.hpp"
#include "proxcgal/safety/guard.hpp"

namespace proxcgal {
namespace {

template <class... Configs>
struct List {};
using AllConfigs =
    List<FilterConfig, MonitorConfig, SolverConfig, MemoryConfig, MotionConfig, SensorModel,
         Avoidance, Reach, JointLimits, MinimumAltitude, Manipulability, SelfCollision,
         ControllerConfig, IsoSeparation, OperatorCapsule, SeparationConfig, SafetyTiming,
         GuardConfig, AdmittanceConfig, HandGuideConfig>;

/// Calls `visit.operator()<Config>()` for each config.
template <class Visit, class... Configs>
void each(List<Configs...>, const Visit& visit) {
  (visit.template operator()<Configs>(), ...);
}

std::string refusal(const std::function<void()>& call) {
  try {
    call();
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

/// Takes the place of any member in an aggregate's braces.
struct Any {
  template <class Member>
  operator Member() const;  // NOLINT(google-explicit-constructor)
};
template <std::size_t>
using AnyAt = Any;
template <class Config, std::size_t... kAt>
constexpr bool takes(std::index_sequence<kAt...>) {
  return requires { Config{AnyAt<kAt>{}...}; };
}
template <class Config, std::size_t kCount>
constexpr bool has_members() {
  return takes<Config>(std::make_index_sequence<kCount>{}) &&
         !takes<Config>(std::make_index_sequence<kCount + 1>{});
}

TEST(Fields, EveryTableHasAllMembersOfItsStruct) {
  each(AllConfigs{}, []<class Config>() {
    constexpr std::size_t count = std::tuple_size_v<decltype(fields<Config>.entries)>;
    EXPECT_TRUE((has_members<Config, count>())) << fields<Config>.name;
  });
}

TEST(Fields, EveryFieldHasItsOwnNameAKnownUnitAndASentence) {
  const std::set<std::string> units{"",
                                    "s",
                                    "m",
                                    "m/s",
                                    "1/s",
                                    "rad",
                                    "rad/s",
                                    "rad/s^2",
                                    "rad or m",
                                    "rad/s or m/s",
                                    "rad/s^2 or m/s^2",
                                    "kg, kg m^2",
                                    "N, N m",
                                    "N s/m, N m s/rad"};
  each(AllConfigs{}, [&]<class Config>() {
    std::set<std::string> names;
    for (const FieldRecord& record : field_records<Config>()) {
      const std::string name = std::string(fields<Config>.name) + "." + record.name;
      EXPECT_TRUE(names.insert(record.name).second) << name;
      EXPECT_TRUE(units.contains(record.unit)) << name << ": " << record.unit;
      EXPECT_TRUE(record.sentence.size() > 8 && record.sentence.ends_with('.')) << name;
      EXPECT_FALSE(record.type.empty()) << name;
    }
  });
}

TEST(Fields, DefaultsAreInTheirBounds) {
  each(AllConfigs{}, []<class Config>() {
    if constexpr (std::is_same_v<Config, GuardConfig>) {
      EXPECT_NE(refusal([] { validate(Config{}); }), "");  // its capsules have no default
    } else {
      EXPECT_EQ(refusal([] { validate(Config{}); }), "");
    }
  });
}

/// Values at and beside the ends of a bound.
std::vector<double> around(const Bound& bound, bool whole) {
  std::vector<double> values{std::numeric_limits<double>::quiet_NaN(), kInfinity, -kInfinity};
  if (whole) values.clear();
  for (const double end : {bound.least, bound.most}) {
    if (std::isinf(end)) continue;
    const double step = whole ? 1.0 : 0.0;
    values.push_back(end);
    values.push_back(whole ? end - step : std::nextafter(end, -kInfinity));
    values.push_back(whole ? end + step : std::nextafter(end, kInfinity));
  }
  return values;
}

TEST(Fields, EachBoundRefusesWhatIsJustOutsideAndTakesWhatIsJustInside) {
  each(AllConfigs{}, []<class Config>() {
    each_leaf<Config>([](const auto& leaf) {
      Config config;
      using Member = std::remove_cvref_t<decltype(leaf.of(config))>;
      if constexpr (std::is_same_v<Member, double> || std::is_same_v<Member, int>) {
        const std::string name = std::string(fields<Config>.name) + "." + leaf.name();
        for (const double value : around(leaf.field.bound, std::is_same_v<Member, int>)) {
          leaf.of(config) = static_cast<Member>(value);
          const std::string said =
              refusal([&] { detail::validate_value(leaf.field, name, leaf.of(config)); });
          const bool allowed =
              (value > leaf.field.bound.least ||
               (value == leaf.field.bound.least && leaf.field.bound.least_included)) &&
              (value < leaf.field.bound.most ||
               (value == leaf.field.bound.most && leaf.field.bound.most_included));
          EXPECT_EQ(said.empty(), allowed) << name << " = " << value;
          if (allowed) continue;
          EXPECT_TRUE(said.starts_with(name + " is ")) << said;
          const std::string whole = refusal([&] { validate(config); });
          if constexpr (!std::is_same_v<Config, GuardConfig>) {
            EXPECT_EQ(whole, said);
          }
        }
      }
    });
  });
}

TEST(Fields, MessagesNameFieldValueUnitAndWhatIsAllowed) {
  const auto said = [](const auto& config) { return refusal([&] { validate(config); }); };
  EXPECT_EQ(said(MonitorConfig{.hold_after = -1.0}),
            "MonitorConfig.hold_after is -1 s, must be above 0 s or inf");
  EXPECT_EQ(said(MonitorConfig{.degraded_scale = 1.5}),
            "MonitorConfig.degraded_scale is 1.5, must be between 0 and 1");
  EXPECT_EQ(said(MonitorConfig{.clean_cycles = 0}),
            "MonitorConfig.clean_cycles is 0, must be at least 1");
  EXPECT_EQ(said(FilterConfig{.tolerance = kInfinity}),
            "FilterConfig.tolerance is inf m, must be finite and at least 0 m");
  EXPECT_EQ(said(FilterConfig{.z_min = kInfinity}),
            "FilterConfig.z_min is inf m, must be finite or -inf");
  EXPECT_EQ(said(SensorModel{.field_of_view = 3.0}),
            "SensorModel.field_of_view is 3 rad, must be above 0 and below 3 rad");
  EXPECT_EQ(said(MemoryConfig{.max_points = 2}),
            "MemoryConfig.max_points is 2, must be between 3 and 65536");
  EXPECT_EQ(said(AdmittanceConfig{.mass = Vector6::Zero()}),
            "AdmittanceConfig.mass is (0, 0, 0, 0, 0, 0) kg, kg m^2, must be finite and above "
            "0 kg, kg m^2 each");
  EXPECT_EQ(said(ControllerConfig{.tasks = {}}),
            "ControllerConfig.tasks is 0 entries, must be between 1 and 16 entries");
  EXPECT_EQ(said(ControllerConfig{.tasks = {Reach{.gain = 0.0}}}),
            "Reach.gain is 0 1/s, must be finite and above 0 1/s");
  EXPECT_EQ(said(ControllerConfig{.monitor = {.stuck_after = 0.0}}),
            "ControllerConfig.monitor.stuck_after is 0 s, must be above 0 s or inf");
  EXPECT_EQ(said(ControllerConfig{.memory = MemoryConfig{.voxel = 1.0}}),
            "ControllerConfig.memory.voxel is 1 m, must be between 0.005 and 0.5 m");
}

TEST(Fields, SettingsThatDependOnOneAnotherAreChecked) {
  const auto said = [](const auto& config) { return refusal([&] { validate(config); }); };
  EXPECT_EQ(said(MonitorConfig{.joints_hold_after = 0.2}),
            "MonitorConfig.joints_stop_after is 0.1 s, must be at least joints_hold_after = 0.2 s");
  EXPECT_EQ(said(SensorModel{.min_range = 4.0}),
            "SensorModel.max_range is 4 m, must be above min_range = 4 m");
  EXPECT_EQ(said(Manipulability{.low = 0.1}),
            "Manipulability.high is 0.05, must be above low = 0.1");
  EXPECT_EQ(said(Manipulability{.joints = 3}),
            "Manipulability.joints is 3, must be 0 (all) or between 6 and 32");
  EXPECT_EQ(said(IsoSeparation{.intrusion = 0.1, .robot_uncertainty = -0.2}),
            "IsoSeparation.intrusion + human_uncertainty + robot_uncertainty is -0.1 m, must be at "
            "least 0 m");
  GuardConfig guard{.capsules = std::vector<LinkCapsule>(1)};
  guard.separation.human.height = 0.3;
  EXPECT_EQ(said(guard),
            "GuardConfig.human_height is 0.3 m, must be at least twice the radius of 0.2 m");
  guard.separation.human.height = 1.8;
  guard.timing.max_gap = 0.0005;
  EXPECT_EQ(said(guard), "GuardConfig.max_gap is 0.0005 s, must be at least the period of 0.001 s");
  guard.timing.max_gap = 0.01;
  guard.separation.iso.human_speed = -1.0;
  EXPECT_EQ(said(guard),
            "GuardConfig.iso.human_speed is -1 m/s, must be finite and at least 0 m/s");
}

TEST(Fields, ANameIsOneOfItsChoices) {
  for (const Choice<Confirmation>& choice : choices<Confirmation>)
    EXPECT_EQ(choice_of<Confirmation>(choice.name, "confirmation"), choice.value);
  EXPECT_EQ(refusal([] { choice_of<Confirmation>("on", "FilterConfig.confirmation"); }),
            "FilterConfig.confirmation is 'on', must be one of 'off', 'zones', 'scans'");
}

TEST(Fields, RecordsHaveDefaultBoundAndChoices) {
  const std::vector<FieldRecord> records = field_records<GuardConfig>();
  const auto record = [&](const std::string& name) {
    for (const FieldRecord& each : records)
      if (each.name == name) return each;
    return FieldRecord{};
  };
  EXPECT_EQ(std::get<double>(record("stop_time").standard), 0.35);
  EXPECT_EQ(record("human_offset").size, 3);
  EXPECT_EQ(std::get<std::vector<double>>(record("human_offset").standard),
            (std::vector<double>{0.0, 0.0, 0.25}));
  EXPECT_TRUE(record("capsules").required);
  EXPECT_EQ(record("iso").config, "IsoSeparation");
  const FieldRecord confirmation = field_records<FilterConfig>()[4];
  EXPECT_EQ(confirmation.choices, (std::vector<std::string>{"off", "zones", "scans"}));
  EXPECT_EQ(std::get<std::string>(confirmation.standard), "off");
  const FieldRecord tasks = field_records<ControllerConfig>()[1];
  EXPECT_EQ(std::get<std::vector<std::string>>(tasks.standard),
            (std::vector<std::string>{"avoidance", "reach"}));
}

}  // namespace
}  // namespace proxcgal
