#pragma once
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <initializer_list>
#include <string>
#include <utility>

#include "proxcgal/error.hpp"
#include "proxcgal/types.hpp"

/// From what a user passes to what the core takes: shape, type and finiteness are told by name.
namespace proxcgal::binding {

namespace nb = nanobind;
using namespace nb::literals;  // NOLINT(google-build-using-namespace): "name"_a

using ArrayView = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;

inline std::string text_of(nb::handle value) { return nb::cast<std::string>(nb::str(value)); }

/// How strictly an argument is taken.
enum class Take {
  kConvert,  ///< set-up: whatever numpy can turn into float64, once
  kExact,    ///< tick: C-contiguous float64 or nothing
};

inline std::string shape_of(const ArrayView& array) {
  std::string text = "(";
  for (std::size_t i = 0; i < array.ndim(); ++i)
    text += (i > 0 ? ", " : "") + std::to_string(array.shape(i));
  return text + (array.ndim() == 1 ? ",)" : ")");
}

/// What a user passed instead of an array that can be taken: of an array its type and layout.
inline std::string kind_of(nb::handle value) {
  const nb::object ndarray = nb::module_::import_("numpy").attr("ndarray");
  if (!nb::isinstance(value, ndarray)) return text_of(value.type().attr("__name__"));
  const bool contiguous = nb::cast<bool>(value.attr("flags").attr("c_contiguous"));
  return std::string(contiguous ? "" : "a not C-contiguous ") + "array of type " +
         text_of(value.attr("dtype"));
}

/// @throws GeometryError  naming the argument, what it is and what it must be
inline ArrayView array_from(nb::handle value, const char* name, const std::string& expected,
                            Take take) {
  ArrayView view;
  if (nb::try_cast(value, view, false)) return view;
  const auto refuse = [&]() {
    const char* layout = take == Take::kExact ? "C-contiguous " : "";
    throw GeometryError(std::string(name) + " is " + kind_of(value) + ", expected " + layout +
                        expected);
  };
  if (take == Take::kExact) refuse();
  try {
    const nb::object numpy = nb::module_::import_("numpy");
    const nb::object given = numpy.attr("asarray")(value);
    // Imaginary parts would be dropped with no more than a warning.
    if (text_of(given.attr("dtype").attr("kind")) == "c") refuse();
    // ascontiguousarray makes a number an array of one row: that is no array that was passed.
    const nb::object array = numpy.attr("ascontiguousarray")(given, "dtype"_a = "float64");
    if (nb::cast<int>(given.attr("ndim")) > 0 && nb::try_cast(array, view, false)) return view;
  } catch (const nb::python_error&) {
    // told below, with the argument's name
  }
  refuse();
  return view;
}

inline void require_shape(const ArrayView& view, const char* name, const std::string& expected,
                          std::initializer_list<std::int64_t> shape) {
  bool fits = view.ndim() == shape.size();
  std::size_t axis = 0;
  for (const std::int64_t size : shape) {
    if (fits && size >= 0) fits = view.shape(axis) == static_cast<std::size_t>(size);
    ++axis;
  }
  if (!fits) {
    throw GeometryError(std::string(name) + " has shape " + shape_of(view) + ", expected " +
                        expected);
  }
}

inline Eigen::Map<const Points> points_view(const ArrayView& view, const char* name) {
  require_shape(view, name, "(n, 3)", {-1, 3});
  return {view.data(), static_cast<Eigen::Index>(view.shape(0)), 3};
}

inline void require_finite(const Eigen::Ref<const Points>& points, const char* name) {
  if (points.allFinite() && (points.size() == 0 || points.cwiseAbs().maxCoeff() <= kFarthest))
    return;
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    if (!points.row(i).allFinite() || points.row(i).cwiseAbs().maxCoeff() > kFarthest) {
      throw GeometryError(
          std::string(name) + " row " + std::to_string(i) +
          " is not finite or farther than 1e9 m: every coordinate must be finite [m]");
    }
  }
}

/// An (n, 3) argument of a set-up call, checked; the array lives as long as this does.
class PointsArgument {
 public:
  PointsArgument(nb::handle value, const char* name)
      : view_(array_from(value, name, "(n, 3) float64", Take::kConvert)),
        map_(points_view(view_, name)) {
    require_finite(map_, name);
  }
  const Eigen::Map<const Points>& operator()() const { return map_; }

 private:
  ArrayView view_;
  Eigen::Map<const Points> map_;
};

/// Face indices of any integer type; whether they exist is the mesh's own check.
inline Triangles triangles_from(nb::handle value) {
  const nb::object numpy = nb::module_::import_("numpy");
  nb::object array;
  try {
    array = numpy.attr("asarray")(value);
  } catch (const nb::python_error&) {
    throw GeometryError("triangles is " + kind_of(value) +
                        " that is no array, expected integers of shape (f, 3)");
  }
  const std::string kind = nb::cast<std::string>(array.attr("dtype").attr("kind"));
  if (kind != "i" && kind != "u") {
    throw GeometryError("triangles has type " + text_of(array.attr("dtype")) +
                        ", expected integers of shape (f, 3)");
  }
  // By 64 bit, so that an index too large for 32 is told and not wrapped.
  nb::ndarray<const std::int64_t, nb::c_contig, nb::device::cpu> view;
  if (!nb::try_cast(numpy.attr("ascontiguousarray")(array, "dtype"_a = "int64"), view) ||
      view.ndim() != 2 || view.shape(1) != 3) {
    throw GeometryError("triangles has shape " + text_of(array.attr("shape")) +
                        ", expected (f, 3)");
  }
  Triangles triangles(static_cast<Eigen::Index>(view.shape(0)), 3);
  for (Eigen::Index i = 0; i < triangles.size(); ++i) {
    const std::int64_t index = view.data()[i];
    if (index < 0 || index > INT32_MAX) {
      throw GeometryError("triangle " + std::to_string(i / 3) + " uses vertex " +
                          std::to_string(index) + ": allowed are 0 and more");
    }
    triangles.data()[i] = static_cast<std::int32_t>(index);
  }
  return triangles;
}

/// @param size  expected length, -1 for any
inline Eigen::VectorXd vector_from(nb::handle value, const char* name, std::int64_t size, Take take,
                                   bool finite = true) {
  const std::string expected =
      size >= 0 ? "(" + std::to_string(size) + ",) float64" : "(n,) float64";
  const ArrayView view = array_from(value, name, expected, take);
  require_shape(view, name, expected, {size});
  Eigen::VectorXd vector =
      Eigen::Map<const Eigen::VectorXd>(view.data(), static_cast<Eigen::Index>(view.shape(0)));
  if (finite && !vector.allFinite()) throw GeometryError(std::string(name) + " is not finite");
  return vector;
}

/// As many numbers as there may be joints at most: more do not fit into a JointVector.
/// @param value  None for no number at all
inline JointVector joints_from(nb::handle value, const char* name, bool finite = true) {
  if (value.is_none()) return {};
  const Eigen::VectorXd joints = vector_from(value, name, -1, Take::kConvert, finite);
  if (joints.size() <= kMaxJoints) return joints;
  throw GeometryError(std::string(name) + " has " + std::to_string(joints.size()) +
                      " rows, one a joint: at most " + std::to_string(kMaxJoints) +
                      " are supported");
}

inline Vector3 vector3_from(nb::handle value, const char* name, Take take = Take::kConvert) {
  return vector_from(value, name, 3, take);
}

/// What an argument `bound` may be: distances are looked for below it.
inline void require_bound(double bound) { require(bound >= 0.0, "bound", bound, "0 m or more"); }

/// @param rigid  refuse what is no rotation and translation
inline Pose pose_from(nb::handle value, const char* name, Take take = Take::kConvert,
                      bool rigid = true) {
  const ArrayView view = array_from(value, name, "(4, 4) float64", take);
  require_shape(view, name, "(4, 4)", {4, 4});
  Pose pose;
  pose.matrix() = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(view.data());
  if (rigid) {
    if (!pose.matrix().allFinite())
      throw GeometryError(std::string(name) + " is not finite: it holds NaN or infinity");
    const Eigen::Matrix3d R = pose.linear();
    const bool ok = (R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-6 &&
                    R.determinant() > 0.0 && pose.matrix().row(3) == Eigen::RowVector4d(0, 0, 0, 1);
    if (!ok)
      throw GeometryError(std::string(name) +
                          " is no pose: expected a rotation, a translation and the row 0 0 0 1");
  }
  return pose;
}

/// Numpy arrays that own what they hold.
inline nb::ndarray<nb::numpy, double> poses_to_numpy(const std::vector<Pose>& poses) {
  auto* data = new double[poses.size() * 16];
  for (std::size_t i = 0; i < poses.size(); ++i) {
    Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(data + 16 * i) = poses[i].matrix();
  }
  const nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<double*>(p); });
  return {data, {poses.size(), 4, 4}, owner};
}

inline Eigen::Matrix<double, 4, 4, Eigen::RowMajor> to_matrix(const Pose& pose) {
  return pose.matrix();
}

}  // namespace proxcgal::binding
