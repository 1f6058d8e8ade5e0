// What measurements may show beside effects with a name. Each kind of measurement has one table of such hypotheses, in the order
// in which they are asked: what is found of one makes others needless, leaves something without a name, and is said. How each is
// found stands with its kind.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/status.h>

#include "server/diagnosis/engine/competition/result.h"

namespace touchstone::diagnosis::engine {

// What a hypothesis leaves without a name; all but the first make the verdict UNEXPLAINED.
enum class Leaves {
  kNothing,
  kBeside,  // nothing is said against effects: of the noise alone, which moves no mean, or it has competed with each of them
  kMeans,
  kDoubts,  // of the means, and it speaks against the steps that were found
};

// A row of a table.
struct HypothesisRule {
  int hypothesis = 0;  // of the kind's enumeration: its place in the table
  const char* name = "";
  Leaves leaves = Leaves::kNothing;
  std::vector<int> excludes;  // hypotheses that are not asked once this one was found
  int said = 0;               // place among those that have words: the first that was found says what is left
  bool and_next = false;      // its words are followed by those of the next
};

// Those of a table that were found in one set.
class Hypotheses {
 public:
  using Describe = std::function<void(UnexplainedRest*)>;
  using Questions = std::map<int, std::function<absl::Status()>>;  // by hypothesis

  // `rules` must outlive it.
  explicit Hypotheses(const std::vector<HypothesisRule>& rules) : rules_(&rules) {}

  // Asks from the first row to the last what is not excluded by what was found before. A row without a question is found by
  // that of another, or asked elsewhere.
  absl::Status Ask(const Questions& questions) const;

  // `words`: sentences for people; may be empty. `describe`: what it knows of the rest beside.
  void Add(int hypothesis, std::string words = "", Describe describe = nullptr);
  // The answer to a question of which only this is asked.
  absl::Status AddIf(bool is_so, int hypothesis, std::string words = "", Describe describe = nullptr) {
    if (is_so) Add(hypothesis, std::move(words), std::move(describe));
    return absl::OkStatus();
  }
  bool Has(int hypothesis) const;
  bool Allows(int hypothesis) const;

  bool Leave(Leaves least) const;  // this or more
  // Of the first that has words, and of what follows it.
  std::string Words() const;
  // By each in the order in which they were found, with the words.
  void DescribeRest(UnexplainedRest* rest) const;

 private:
  struct Found {
    const HypothesisRule* rule;
    std::string words;
    Describe describe;
  };
  template <typename Predicate>
  bool Any(Predicate predicate) const;

  const std::vector<HypothesisRule>* rules_;
  std::vector<Found> found_;  // in the order in which they were added
};

}  // namespace touchstone::diagnosis::engine
