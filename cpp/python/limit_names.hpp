#pragma once
#include "proxcgal/pipeline/limit.hpp"

namespace proxcgal::binding {

inline const char* kind_name(LimitKind kind) {
  switch (kind) {
    case LimitKind::kJoint:
      return "joint";
    case LimitKind::kApproach:
      return "approach";
    case LimitKind::kOwnApproach:
      return "own_approach";
    case LimitKind::kFloor:
      return "floor";
    case LimitKind::kUnknown:
      return "unknown";
    case LimitKind::kRetreat:
      return "retreat";
    case LimitKind::kOwnRetreat:
      return "own_retreat";
  }
  return "";
}

inline const char* status_name(LimitStatus status) {
  switch (status) {
    case LimitStatus::kUnchanged:
      return "unchanged";
    case LimitStatus::kLimited:
      return "limited";
    case LimitStatus::kPartly:
      return "partly";
    case LimitStatus::kBraking:
      return "braking";
  }
  return "";
}

}  // namespace proxcgal::binding
