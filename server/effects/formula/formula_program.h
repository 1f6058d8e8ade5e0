// A compiled expression: muParser behind a narrow door. Arithmetic only: no assignment, no text, no access to
// anything but the variables that the caller fills in.
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

namespace touchstone::effects {

// Names in the order of their first use in an expression, each with the place of that use.
struct UsedName {
  std::string name;
  int character = 0;  // from 1
};

class FormulaProgram {
 public:
  // The syntax alone is checked; every name that is not a function or a constant is a variable.
  static absl::StatusOr<std::shared_ptr<const FormulaProgram>> Compile(const std::string& expression);
  ~FormulaProgram();

  const std::vector<UsedName>& names() const { return names_; }

  // One thread's evaluator: write inputs()[i] for names()[i], then Value().
  class Evaluator {
   public:
    virtual ~Evaluator() = default;
    virtual double* inputs() = 0;
    virtual double Value() = 0;
  };

  // Lends an evaluator that no one else uses; it goes back when the loan ends. Any thread.
  class Loan {
   public:
    explicit Loan(const FormulaProgram& program);
    ~Loan();
    Loan(const Loan&) = delete;
    Loan& operator=(const Loan&) = delete;
    Evaluator* operator->() const { return evaluator_.get(); }

   private:
    const FormulaProgram& program_;
    std::unique_ptr<Evaluator> evaluator_;
  };

 private:
  FormulaProgram() = default;

  std::string expression_;
  std::vector<UsedName> names_;
  mutable std::mutex mutex_;
  mutable std::vector<std::unique_ptr<Evaluator>> idle_;
};

}  // namespace touchstone::effects
