// The parts of the terminal report that say why and what to do. Each adds nothing if the report has nothing.
#pragma once

#include "client/report/words/text_layout.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::client {

void AddDistributions(const v1::Report& report, TextLayout* out);  // sets without poses
void AddDataProblems(const v1::Report& report, TextLayout* out);   // mistakes of the file
void AddWhy(const v1::Report& report, TextLayout* out);
void AddUnexplained(const v1::Report& report, TextLayout* out);
void AddWhatToDo(const v1::Report& report, TextLayout* out);
// What the predictions of the model that the report ends with are unsure by, a line per contribution, largest first.
void AddBudget(const v1::Report& report, TextLayout* out);
void AddNext(const v1::Report& report, TextLayout* out);        // touches to make, pictures to take
void AddBlindSpots(const v1::Report& report, TextLayout* out);  // effects that the set could not have shown
void AddVersus(const v1::Report& report, TextLayout* out);      // a comparison with a second model
void AddSessions(const v1::Report& report, TextLayout* out);    // several sessions: in place of "How wrong"
// Of photographs.
void AddSilhouettes(const v1::Report& report, TextLayout* out);       // lines of "How wrong"
void AddWorstPhotographs(const v1::Report& report, TextLayout* out);  // the pictures that are off most
void AddNextPhotographs(const v1::Report& report, TextLayout* out);
void AddUnusedRows(const v1::Report& report, TextLayout* out);

}  // namespace touchstone::client
