// Made by client/workbench/build.
#pragma once

namespace touchstone::workbench {

extern const char kPageBytes[];  // the page; empty: this build has none
extern const char kWhyNoPage[];  // then the reason

}  // namespace touchstone::workbench
