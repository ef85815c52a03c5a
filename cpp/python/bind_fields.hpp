#pragma once
#include <nanobind/stl/map.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/variant.h>

#include <map>
#include <utility>

#include "convert.hpp"
#include "proxcgal/fields.hpp"

/// Binds config structs from their tables of fields: a constructor with keyword arguments and
/// defaults, properties with their sentences, `repr`. No binding repeats a name or a default.
namespace proxcgal::binding {

/// Whether properties may be set after construction.
enum class Access : std::uint8_t { kReadOnly, kReadWrite };
/// Whether the constructor validates the config, or the class that takes it.
enum class Validated : std::uint8_t { kHere, kByItsUser };

/// How a value passes to and from Python: type and default of the constructor's argument, and the
/// value of the property.
template <class Value>
struct Passing {
  using Parameter = Value;
  static const Value& standard(const Value& value) { return value; }
  static Value from(Parameter value, const std::string&, bool) { return value; }
  static const Value& give(const Value& value) { return value; }
};
template <HasChoices Enum>
struct Passing<Enum> {
  using Parameter = const std::string&;
  static const char* standard(Enum value) { return choice_name(value); }
  static Enum from(Parameter value, const std::string& field, bool) {
    return choice_of<Enum>(value, field);
  }
  static std::string give(Enum value) { return choice_name(value); }
};
/// None stands for the default where that is no plain value.
template <class Entry>
requires requires(const Entry& entry) { task_name(entry); }
struct Passing<std::vector<Entry>> {
  using Parameter = const std::optional<std::vector<Entry>>&;
  static nb::none standard(const std::vector<Entry>&) { return {}; }
  static std::optional<std::vector<Entry>> from(Parameter value, const std::string&, bool) {
    return value;
  }
  static const std::vector<Entry>& give(const std::vector<Entry>& value) { return value; }
};
template <class Config>
struct Passing<std::optional<Config>> {
  using Parameter = const std::optional<Config>&;
  static nb::none standard(const std::optional<Config>&) { return {}; }
  static const std::optional<Config>& from(Parameter value, const std::string&, bool) {
    return value;
  }
  static const std::optional<Config>& give(const std::optional<Config>& value) { return value; }
};
template <detail::IsNumbers Vector>
struct Passing<Vector> {
  static constexpr int kSize = Vector::SizeAtCompileTime;
  using Owned = Eigen::Matrix<double, kSize, 1>;
  using Parameter = nb::handle;
  static nb::none standard(const Vector&) { return {}; }
  static std::optional<Vector> from(Parameter value, const std::string& field, bool finite) {
    if (value.is_none()) return std::nullopt;
    if constexpr (kSize == Eigen::Dynamic) {
      return joints_from(value, field.c_str(), finite);
    } else {
      return Vector(vector_from(value, field.c_str(), kSize, Take::kConvert, finite));
    }
  }
  static Owned give(const Vector& value) { return value; }
};

/// Field number `kAt` of a config, those of its parts counted.
template <class Config, std::size_t kAt>
struct FieldAt {
  static constexpr const auto& leaf() { return std::get<kAt>(leaves<Config>); }
  using Value = std::remove_cvref_t<decltype(leaf().of(std::declval<Config&>()))>;
  using Pass = Passing<Value>;
  using Parameter = typename Pass::Parameter;

  /// @param finite  numbers that are not finite are refused here, where no bound allows them
  static void take(Config& config, Parameter value, bool finite) {
    const auto& field = leaf().field;
    auto&& taken = Pass::from(std::forward<Parameter>(value),
                              std::string(fields<Config>.name) + "." + leaf().name(),
                              finite && !field.bound.may_be_infinite());
    using Taken = std::remove_cvref_t<decltype(taken)>;
    if constexpr (std::is_same_v<Taken, Value>) {
      leaf().of(config) = std::forward<decltype(taken)>(taken);
    } else if (taken) {
      leaf().of(config) = *std::forward<decltype(taken)>(taken);
    }
  }
  static decltype(auto) give(const Config& config) { return Pass::give(leaf().of(config)); }
  /// @param names  of all fields; must outlive the definition that the argument is for
  static auto argument(const std::vector<std::string>& names) {
    const nb::arg name(names[kAt].c_str());
    if constexpr (leaf().field.kIsRequired) {
      return name;
    } else {
      return name = Pass::standard(leaf().of(std::as_const(fresh())));
    }
  }

 private:
  static const Config& fresh() {
    static const Config config{};
    return config;
  }
};

template <class Config>
using EveryField = std::make_index_sequence<std::tuple_size_v<decltype(leaves<Config>)>>;

template <class Config>
std::vector<std::string> field_names() {
  std::vector<std::string> names;
  each_leaf<Config>([&](const auto& leaf) { names.push_back(leaf.name()); });
  return names;
}

/// A config of one value for each field, in the order of the table.
template <class Config, std::size_t... kAt>
Config config_from(std::index_sequence<kAt...>, bool finite,
                   typename FieldAt<Config, kAt>::Parameter... values) {
  Config config;
  (FieldAt<Config, kAt>::take(
       config, std::forward<typename FieldAt<Config, kAt>::Parameter>(values), finite),
   ...);
  return config;
}

/// "[s] Age of an array's scans that holds the arm."
inline std::string docstring(const FieldRecord& record) {
  std::string text = (record.unit.empty() ? "" : "[" + record.unit + "] ") + record.sentence;
  for (const std::string& name : record.choices)
    text += (&name == &record.choices.front() ? " One of '" : ", '") + name + "'";
  return text + (record.choices.empty() ? "" : ".");
}

/// The tables of all structs that were bound, by name.
inline std::map<std::string, std::vector<FieldRecord>>& bound_tables() {
  static std::map<std::string, std::vector<FieldRecord>> tables;
  return tables;
}
template <class Config>
void register_table();
template <class Struct, class Part>
void register_part(const FieldsOf<Struct, Part>&) {
  register_table<Part>();
}
template <class Struct, class Member, bool kRequired>
void register_part(const Field<Struct, Member, kRequired>&) {}
template <class Config>
void register_table() {
  bound_tables()[fields<Config>.name] = field_records<Config>();
  std::apply([](const auto&... entry) { (register_part(entry), ...); }, fields<Config>.entries);
}

template <Access kAccess, class Config, std::size_t kAt>
void bind_property(nb::class_<Config>& config, const FieldRecord& record) {
  using At = FieldAt<Config, kAt>;
  const std::string doc = docstring(record);
  const auto give = [](const Config& self) -> decltype(auto) { return At::give(self); };
  if constexpr (kAccess == Access::kReadWrite && !At::leaf().field.fixed) {
    const auto take = [](Config& self, typename At::Parameter value) {
      At::take(self, std::forward<typename At::Parameter>(value), true);
    };
    config.def_prop_rw(record.name.c_str(), give, take, doc.c_str());
  } else {
    config.def_prop_ro(record.name.c_str(), give, doc.c_str());
  }
}

template <class Config>
std::string representation(const std::vector<std::string>& names, nb::handle self) {
  std::string text = std::string(fields<Config>.name) + "(";
  for (const std::string& name : names) {
    text += (&name == &names.front() ? "" : ", ") + name + "=";
    text += nb::repr(self.attr(name.c_str())).c_str();
  }
  return text + ")";
}

template <Access kAccess, Validated kValidated, class Config, std::size_t... kFirst,
          std::size_t... kRest, std::size_t... kAll>
void bind_members(nb::class_<Config>& config, const char* doc, std::index_sequence<kFirst...>,
                  std::index_sequence<kRest...>, std::index_sequence<kAll...>) {
  const std::vector<std::string> names = field_names<Config>();
  config.def(
      "__init__",
      [](Config* self, typename FieldAt<Config, kAll>::Parameter... values) {
        constexpr bool here = kValidated == Validated::kHere;
        Config made =
            config_from<Config>(std::index_sequence<kAll...>{}, !here,
                                std::forward<typename FieldAt<Config, kAll>::Parameter>(values)...);
        if constexpr (here) validate(made);
        new (self) Config(std::move(made));
      },
      FieldAt<Config, kFirst>::argument(names)..., nb::kw_only(),
      FieldAt<Config, sizeof...(kFirst) + kRest>::argument(names)..., doc);
  const std::vector<FieldRecord> records = field_records<Config>();
  (bind_property<kAccess, Config, kAll>(config, records[kAll]), ...);
  config.def("__repr__", [names](nb::handle self) { return representation<Config>(names, self); });
}

/// @tparam kPositional  so many first fields may be given by position
template <class Config, Access kAccess = Access::kReadOnly, std::size_t kPositional = 0,
          Validated kValidated = Validated::kHere>
nb::class_<Config> bind_fields(
    nb::module_& m,
    const char* doc = "Raises: ConfigError with field, value and what is allowed.") {
  register_table<Config>();
  nb::class_<Config> config(m, fields<Config>.name, fields<Config>.summary);
  bind_members<kAccess, kValidated>(
      config, doc, std::make_index_sequence<kPositional>{},
      std::make_index_sequence<EveryField<Config>::size() - kPositional>{}, EveryField<Config>{});
  return config;
}

/// `FieldRecord` and `field_tables`, after everything that is bound from a table.
inline void bind_field_tables(nb::module_& m) {
  nb::class_<FieldRecord>(m, "FieldRecord", "One setting of a config, as its table declares it.")
      .def_ro("name", &FieldRecord::name, "As the constructor takes it.")
      .def_ro("unit", &FieldRecord::unit, "SI; empty for none.")
      .def_ro("type", &FieldRecord::type,
              "'float', 'int', 'bool', 'enum', 'vector' of numbers, 'config' with a table of its "
              "own, 'strings', 'pairs' of strings, 'tasks', or 'list'.")
      .def_ro("default", &FieldRecord::standard,
              "None where required, of a config, and where the robot decides.")
      .def_prop_ro(
          "least", [](const FieldRecord& r) { return r.bound.least; },
          "Of a number, of each in a vector, of the entries in a list.")
      .def_prop_ro(
          "most", [](const FieldRecord& r) { return r.bound.most; }, "The same.")
      .def_prop_ro(
          "least_exclusive", [](const FieldRecord& r) { return !r.bound.least_included; },
          "`least` itself is not allowed.")
      .def_prop_ro(
          "most_exclusive", [](const FieldRecord& r) { return !r.bound.most_included; },
          "`most` itself is not allowed.")
      .def_prop_ro(
          "may_be_infinite", [](const FieldRecord& r) { return r.bound.may_be_infinite(); },
          "Infinity is allowed, at the ends that are not exclusive.")
      .def_ro("choices", &FieldRecord::choices, "Names that an 'enum' may have.")
      .def_ro("config", &FieldRecord::config, "Name of a config's own table.")
      .def_ro("size", &FieldRecord::size, "Of a vector; 0: one number a joint.")
      .def_ro("required", &FieldRecord::required, "There is no default.")
      .def_ro("optional", &FieldRecord::optional, "May be None.")
      .def_ro("fixed", &FieldRecord::fixed, "Settable at construction only.")
      .def_ro("sentence", &FieldRecord::sentence, "What it does.");
  m.def(
      "field_tables", [] { return bound_tables(); },
      "The tables of fields of all configs, by the config's name.");
}

}  // namespace proxcgal::binding
