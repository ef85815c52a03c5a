#pragma once
#include <memory>

#include "proxcgal/types.hpp"

namespace proxcgal::detail {

/// The point of least norm with C y >= b, by the dual active-set method of Goldfarb and Idnani.
///
/// Rows are kept at unit norm. Storage is made at set-up and padded to a fixed size; a solve
/// allocates nothing.
class LeastDistance {
 public:
  /// @param variables, rows  the most that will be used: at most 48 and 128
  static std::unique_ptr<LeastDistance> make(int variables, int rows);
  virtual ~LeastDistance() = default;

  void begin(int variables);
  /// Adds a row, zero beyond the coefficients given.
  /// @return  its index; -1 where it is left out, as its coefficients are zero, or there is no room
  int add(const Eigen::Ref<const Eigen::VectorXd>& coefficients, double least);
  /// Adds to a row, before the solve, the coefficient of one more variable.
  int add(const Eigen::Ref<const Eigen::VectorXd>& coefficients, int variable, double coefficient,
          double least);
  /// @return  false where no point was found, or a number overflowed
  virtual bool solve() = 0;

  double y(int variable) const { return y_[variable]; }
  /// Multiplier of a row as it was added, at least 0; 0 for -1.
  double multiplier(int row) const;
  /// Is a row held with equality at the solution?
  bool holds(int row) const { return multiplier(row) > 0.0; }
  int iterations() const { return iterations_; }

 protected:
  LeastDistance(int variables, int rows) : capacity_(variables), stride_(rows) {}

  int capacity_, stride_;     // variables; rows
  double* C_ = nullptr;       // (rows, variables), column by column
  double* least_ = nullptr;   // -b
  double* y_ = nullptr;       // the point
  double* lambda_ = nullptr;  // multipliers of the rows of unit norm
  Eigen::Matrix<double, 128, 1> norm_;
  int variables_ = 0, rows_ = 0, used_ = 0;
  int iterations_ = 0;
};

}  // namespace proxcgal::detail
