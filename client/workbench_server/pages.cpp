#include "client/workbench_server/pages.h"

#include <absl/strings/str_cat.h>

namespace touchstone::workbench {
namespace {

// A page says every 2 s that it is there (heardEveryMs of data/rig.ts). A browser wakes a hidden one at least once a minute.
constexpr std::chrono::seconds kSilent{10}, kSilentHidden{150};
constexpr std::chrono::seconds kReload{3};
constexpr std::chrono::minutes kRemembered{10};
constexpr size_t kMaxPages = 1000;

}  // namespace

absl::Status Pages::Hear(const std::string& page, const Said& said, Time now, bool* changed) {
  const auto known = pages_.find(page);
  if (known == pages_.end() && pages_.size() >= kMaxPages)
    return absl::ResourceExhaustedError(
        absl::StrCat("there are ", kMaxPages, " pages at once; close some of them"));
  *changed = false;
  Page& heard = pages_[page];
  if (heard.left && !said.begins) return absl::OkStatus();
  const bool hidden = said.hidden;
  *changed = heard.number == 0 || heard.until <= now || heard.hidden != hidden;
  if (heard.number == 0) heard.number = ++last_number_;
  heard.hidden = hidden;
  heard.left = false;
  heard.counted = true;
  heard.until = now + (hidden ? kSilentHidden : kSilent);
  return absl::OkStatus();
}

void Pages::SayGoodbye(const std::string& page, Time now) {
  const auto known = pages_.find(page);
  if (known == pages_.end() || known->second.until <= now) return;
  known->second.left = true;
  known->second.until = now + kReload;
}

bool Pages::IsThere(const std::string& page, Time now) const {
  const auto known = pages_.find(page);
  return known != pages_.end() && now < known->second.until;
}

bool Pages::Went(Time now) {
  bool went = false;
  for (auto page = pages_.begin(); page != pages_.end();) {
    if (page->second.counted && page->second.until <= now) {
      went = true;
      page->second.counted = false;
    }
    page = page->second.until + kRemembered <= now ? pages_.erase(page) : std::next(page);
  }
  return went;
}

std::string Pages::Name(const std::string& page) const {
  const auto known = pages_.find(page);
  return absl::StrCat("page ", known == pages_.end() ? 0 : known->second.number);
}

nlohmann::json Pages::List(Time now, const std::string& also) const {
  nlohmann::json list = nlohmann::json::object();
  for (const auto& [id, page] : pages_) {
    const bool there = now < page.until;
    if (there || id == also) list[id] = {{"number", page.number}, {"hidden", page.hidden}, {"there", there}};
  }
  return list;
}

}  // namespace touchstone::workbench
