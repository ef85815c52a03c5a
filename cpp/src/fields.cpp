#include "proxcgal/fields.hpp"

#include <cmath>
#include <sstream>

namespace proxcgal {
namespace {

std::string number(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

}  // namespace

std::string Bound::text(std::string_view unit, bool whole) const {
  const std::string suffix = unit.empty() ? "" : " " + std::string(unit);
  if (std::isfinite(least) && std::isfinite(most) && least_included && most_included)
    return "between " + number(least) + " and " + number(most) + suffix;
  std::string allowed;
  if (std::isfinite(least)) allowed = (least_included ? "at least " : "above ") + number(least);
  if (std::isfinite(most)) {
    allowed += std::string(allowed.empty() ? "" : " and ") +
               (most_included ? "at most " : "below ") + number(most);
  }
  const bool closed = std::isfinite(least) && std::isfinite(most);
  if (!allowed.empty()) allowed += suffix;
  if (closed || whole) return allowed;
  if (!may_be_infinite()) return std::string("finite") + (allowed.empty() ? "" : " and ") + allowed;
  const char* infinite = holds(kInfinity) ? "inf" : "-inf";
  return (allowed.empty() ? std::string("finite") : allowed) + " or " + infinite;
}

namespace detail {

std::string with_unit(double value, std::string_view unit) {
  return number(value) + (unit.empty() ? "" : " ") + std::string(unit);
}

std::string with_unit(const Eigen::Ref<const Eigen::VectorXd>& values, std::string_view unit) {
  std::string text = "(";
  for (const double value : values) text += (text.size() > 1 ? ", " : "") + number(value);
  return text + ")" + (unit.empty() ? "" : " ") + std::string(unit);
}

void refuse_choice(std::string_view field, std::string_view name,
                   const std::vector<std::string>& known) {
  std::string names;
  for (const std::string& each : known) names += (names.empty() ? "'" : ", '") + each + "'";
  require(false, field, "'" + std::string(name) + "'", "one of " + names);
}

}  // namespace detail
}  // namespace proxcgal
