#pragma once
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "proxcgal/error.hpp"
#include "proxcgal/types.hpp"

/// One table of fields for each config struct: name, unit, bound and sentence of every setting.
///
/// Defaults are the struct's member initialisers. Validation, the Python binding, the scenario
/// schema and the reference page are loops over the table.
namespace proxcgal {

/// The values that a number may have: an interval, each end included or not. An infinite end that
/// is included allows infinity itself; NaN is never allowed.
struct Bound {
  double least = -kInfinity;
  double most = kInfinity;
  bool least_included = false;
  bool most_included = false;

  constexpr Bound at_most(double value) const { return {least, value, least_included, true}; }
  constexpr Bound below(double value) const { return {least, value, least_included, false}; }
  constexpr Bound or_infinite() const { return {least, most, least_included, true}; }
  constexpr Bound or_minus_infinite() const { return {least, most, true, most_included}; }

  constexpr bool holds(double value) const {
    return (value > least || (least_included && value == least)) &&
           (value < most || (most_included && value == most));
  }
  constexpr bool may_be_infinite() const { return holds(kInfinity) || holds(-kInfinity); }
  /// "finite and above 0 s". @param whole  of a whole number, which is finite in any case
  std::string text(std::string_view unit, bool whole = false) const;
};
constexpr Bound finite() { return {}; }
constexpr Bound above(double least) { return {.least = least}; }
constexpr Bound at_least(double least) { return {.least = least, .least_included = true}; }
constexpr Bound between(double least, double most) { return at_least(least).at_most(most); }

/// One value of an enum and the name that users call it by.
template <class Enum>
struct Choice {
  const char* name;
  Enum value;
};
template <class Enum>
Choice(const char*, Enum) -> Choice<Enum>;

/// The names of an enum's values: an array of `Choice`, specialised beside the enum.
template <class Enum>
inline constexpr int choices = 0;

template <class Enum>
constexpr const char* choice_name(Enum value) {
  for (const Choice<Enum>& choice : choices<Enum>)
    if (choice.value == value) return choice.name;
  return "";
}
/// @param field  for the message
/// @throws ConfigError  another name, with those that exist
template <class Enum>
Enum choice_of(std::string_view name, std::string_view field);

/// One setting of a struct.
template <class Struct, class Member, bool kRequired = false>
struct Field {
  static constexpr bool kIsRequired = kRequired;

  Member Struct::*member;
  const char* name;
  const char* unit;
  Bound bound;  ///< of a number, of each of several, or of how many entries a list has
  const char* sentence;
  bool fixed = false;  ///< settable when the object is made only

  /// There is no default: it must be given.
  constexpr Field<Struct, Member, true> required() const {
    return {member, name, unit, bound, sentence, fixed};
  }
  constexpr Field at_construction() const { return {member, name, unit, bound, sentence, true}; }
};
template <class Struct, class Member>
constexpr Field<Struct, Member> field(Member Struct::*member, const char* name, const char* unit,
                                      Bound bound, const char* sentence) {
  return {member, name, unit, bound, sentence};
}
/// Of a setting that is no number.
template <class Struct, class Member>
constexpr Field<Struct, Member> field(Member Struct::*member, const char* name,
                                      const char* sentence) {
  return {member, name, "", at_least(0), sentence};
}

/// The fields of a part, as if they were the struct's own. @param prefix  put before their names
template <class Struct, class Part>
struct FieldsOf {
  Part Struct::*member;
  const char* prefix;
};
template <class Struct, class Part>
constexpr FieldsOf<Struct, Part> fields_of(Part Struct::*member, const char* prefix = "") {
  return {member, prefix};
}

template <class... Entries>
struct FieldTable {
  const char* name;
  const char* summary;
  std::tuple<Entries...> entries;
};
template <class... Entries>
constexpr FieldTable<Entries...> field_table(const char* name, const char* summary,
                                             Entries... entries) {
  return {name, summary, {entries...}};
}

/// The table of a config struct, specialised beside the struct. Settings that depend on one another
/// are checked by a function `check(config, path)` beside the table.
template <class Config>
inline constexpr int fields = 0;

template <class Config>
concept HasFields = !std::is_same_v<std::remove_cv_t<decltype(fields<Config>)>, int>;
template <class Enum>
concept HasChoices =
    std::is_enum_v<Enum> && !std::is_same_v<std::remove_cv_t<decltype(choices<Enum>)>, int>;

/// A field and the way to it from the struct that a table is of, through `fields_of`.
template <class Config, class FieldType, class... Path>
struct Leaf {
  const char* prefix;
  FieldType field;
  std::tuple<Path...> path;

  template <class C>
  constexpr auto& of(C& config) const {
    return std::apply(
        [&](auto... members) -> auto& { return (config.*....*members).*field.member; }, path);
  }
  std::string name() const { return std::string(prefix) + field.name; }
};

namespace detail {

template <class Config, class Struct, class Member, bool kRequired, class... Path>
constexpr auto expand(const char* prefix, const Field<Struct, Member, kRequired>& field,
                      Path... path) {
  using One = Leaf<Config, Field<Struct, Member, kRequired>, Path...>;
  return std::tuple<One>(One{prefix, field, {path...}});
}
template <class Config, class Struct, class Part, class... Path>
constexpr auto expand(const char* prefix, const FieldsOf<Struct, Part>& part, Path... path) {
  const char* inner = part.prefix[0] != '\0' ? part.prefix : prefix;
  return std::apply(
      [&](const auto&... entries) {
        return std::tuple_cat(expand<Config>(inner, entries, path..., part.member)...);
      },
      fields<Part>.entries);
}
template <class Config>
constexpr auto leaves_of() {
  return std::apply(
      [](const auto&... entries) { return std::tuple_cat(expand<Config>("", entries)...); },
      fields<Config>.entries);
}

template <class Value>
inline constexpr bool kIsList = false;
template <class Entry>
inline constexpr bool kIsList<std::vector<Entry>> = true;
template <class Value>
inline constexpr bool kIsOptional = false;
template <class Value>
inline constexpr bool kIsOptional<std::optional<Value>> = true;
template <class Value>
concept IsNumbers = std::is_base_of_v<Eigen::MatrixBase<Value>, Value>;

/// "0.14 s"
std::string with_unit(double value, std::string_view unit);
std::string with_unit(const Eigen::Ref<const Eigen::VectorXd>& values, std::string_view unit);
void refuse_choice(std::string_view field, std::string_view name,
                   const std::vector<std::string>& known);

}  // namespace detail

/// The fields of a config struct, those of its parts spelled out: a tuple of `Leaf`.
template <HasFields Config>
inline constexpr auto leaves = detail::leaves_of<Config>();

/// @param visit  called with each leaf
template <HasFields Config, class Visit>
void each_leaf(Visit&& visit) {
  std::apply([&](const auto&... each) { (visit(each), ...); }, leaves<Config>);
}

/// @param path  of the config, for messages; empty: the struct's name
/// @throws ConfigError  with the field, its value and what is allowed
template <HasFields Config>
void validate(const Config& config, const std::string& path = fields<Config>.name);

namespace detail {

template <class FieldType, class Value>
void validate_value(const FieldType& field, const std::string& name, const Value& value) {
  if constexpr (std::is_same_v<Value, double> || std::is_same_v<Value, int>) {
    require(field.bound.holds(value), name, with_unit(value, field.unit),
            field.bound.text(field.unit, std::is_same_v<Value, int>));
  } else if constexpr (IsNumbers<Value>) {
    bool good = true;
    for (const double each : value) good = good && field.bound.holds(each);
    require(good, name, with_unit(value, field.unit), field.bound.text(field.unit) + " each");
  } else if constexpr (HasFields<Value>) {
    validate(value, name);
  } else if constexpr (kIsOptional<Value>) {
    if (value) validate_value(field, name, *value);
  } else if constexpr (kIsList<Value>) {
    require(field.bound.holds(static_cast<double>(value.size())), name,
            with_unit(static_cast<double>(value.size()), "entries"),
            field.bound.text("entries", true));
    if constexpr (requires { validate(value.front()); })
      for (const auto& each : value) validate(each);
  }
}

template <class Part, class Config>
void check_parts(const Config& config, const std::string& path, const char* prefix);

template <class Struct, class Part>
void check_part(const FieldsOf<Struct, Part>& part, const Struct& config, const std::string& path,
                const char* prefix) {
  check_parts<Part>(config.*part.member, path, part.prefix[0] != '\0' ? part.prefix : prefix);
}
template <class Struct, class Member, bool kRequired>
void check_part(const Field<Struct, Member, kRequired>&, const Struct&, const std::string&,
                const char*) {}

/// What depends on one another, in the struct and in the parts whose fields it has.
template <class Part, class Config>
void check_parts(const Config& config, const std::string& path, const char* prefix) {
  if constexpr (requires { check(config, path); }) check(config, path + prefix);
  std::apply([&](const auto&... entry) { (check_part(entry, config, path, prefix), ...); },
             fields<Part>.entries);
}

}  // namespace detail

template <HasFields Config>
void validate(const Config& config, const std::string& path) {
  const std::string before = path + ".";
  each_leaf<Config>([&](const auto& leaf) {
    detail::validate_value(leaf.field, before + leaf.name(), leaf.of(config));
  });
  detail::check_parts<Config>(config, before, "");
}

template <class Enum>
Enum choice_of(std::string_view name, std::string_view field) {
  std::vector<std::string> known;
  for (const Choice<Enum>& choice : choices<Enum>) {
    if (name == choice.name) return choice.value;
    known.emplace_back(choice.name);
  }
  detail::refuse_choice(field, name, known);
  return Enum{};
}

/// A field of a table, for readers that know no C++ type.
struct FieldRecord {
  using Default = std::variant<std::monostate, bool, int, double, std::string, std::vector<double>,
                               std::vector<std::string>>;

  std::string name;
  std::string unit;  ///< "" for none
  /// "float", "int", "bool", "enum" (one of `choices`), "vector" (numbers), "config" (a table of
  /// its own), "strings", "pairs" (of strings), "tasks" or "list".
  std::string type;
  Default standard;  ///< none where `required`, where the core has no value, and of a config
  Bound bound;       ///< of a number, of each number of a vector, or of how many entries a list has
  std::vector<std::string> choices;
  std::string config;     ///< name of the table of a nested config
  int size = 0;           ///< of a vector; 0: as many as the robot has joints
  bool required = false;  ///< there is no default
  bool optional = false;  ///< may be none
  bool fixed = false;     ///< settable when the object is made only
  std::string sentence;
};

namespace detail {

template <class Value>
void describe(const Value& value, FieldRecord& record) {
  if constexpr (std::is_same_v<Value, bool>) {
    record.type = "bool";
    record.standard = value;
  } else if constexpr (std::is_same_v<Value, int>) {
    record.type = "int";
    record.standard = value;
  } else if constexpr (std::is_same_v<Value, double>) {
    record.type = "float";
    record.standard = value;
  } else if constexpr (HasChoices<Value>) {
    record.type = "enum";
    record.standard = std::string(choice_name(value));
    for (const Choice<Value>& choice : choices<Value>) record.choices.emplace_back(choice.name);
  } else if constexpr (IsNumbers<Value>) {
    record.type = "vector";
    record.size = Value::SizeAtCompileTime > 0 ? static_cast<int>(value.size()) : 0;
    if (value.size() > 0) record.standard = std::vector<double>(value.begin(), value.end());
  } else if constexpr (HasFields<Value>) {
    record.type = "config";
    record.config = fields<Value>.name;
  } else if constexpr (kIsOptional<Value>) {
    describe(typename Value::value_type{}, record);
    record.optional = true;
  } else {
    using Entry = typename Value::value_type;
    std::vector<std::string> names;
    if constexpr (std::is_same_v<Entry, std::string>) {
      record.type = "strings";
      names = value;
    } else if constexpr (std::is_same_v<Entry, std::pair<std::string, std::string>>) {
      record.type = "pairs";
    } else if constexpr (requires { task_name(value.front()); }) {
      record.type = "tasks";
      for (const Entry& each : value) names.emplace_back(task_name(each));
    } else {
      record.type = "list";
    }
    record.standard = names;
  }
}

}  // namespace detail

/// The table of a config struct, with the fields of its parts spelled out.
template <HasFields Config>
std::vector<FieldRecord> field_records() {
  std::vector<FieldRecord> records;
  const Config standard{};
  each_leaf<Config>([&]<class Struct, class Member, bool kRequired, class... Path>(
                        const Leaf<Config, Field<Struct, Member, kRequired>, Path...>& leaf) {
    FieldRecord record{.name = leaf.name(), .unit = leaf.field.unit, .bound = leaf.field.bound};
    detail::describe(leaf.of(standard), record);
    record.required = kRequired;
    if (kRequired) record.standard = {};
    record.fixed = leaf.field.fixed;
    record.sentence = leaf.field.sentence;
    records.push_back(std::move(record));
  });
  return records;
}

}  // namespace proxcgal
