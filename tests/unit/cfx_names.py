"""Published names of IPC-CFX, facts to check ours against.

Source: IPC's own SDK, github.com/IPCConnectedFactoryExchange/CFX at 880255d2f7380f340f56b243a51d99f2136bdae3
(2026-04-17, SDK 2.1.1): public properties of the classes, values of the enumerations (CFX/CFXEnvelope.cs,
CFX/Production/TestAndInspection/UnitsInspected.cs, CFX/Structures/*.cs).
"""

MESSAGE_NAME = "CFX.Production.TestAndInspection.UnitsInspected"
VERSION = "2.1"
PROPERTIES = {
    "CFXEnvelope": "MessageName Version TimeStamp UniqueID Source Target RequestID MessageBody",
    "UnitsInspected": "TransactionId InspectionMethod SamplingInformation Inspector RecipeName RecipeRevision "
    "InspectedUnits InspectedPanel",
    "SamplingInformation": "SamplingMethod LotSize SampleSize",
    "InspectedUnit": "UnitIdentifier UnitPositionNumber OverallResult Inspections Verification TotalInspectionCount",
    "Inspection": "UniqueIdentifier InspectionName InspectionStartTime InspectionEndTime TestProcedure Comments Result "
    "Verification VerificationDetail Error DefectsFound Symptoms Measurements RefNo",
    "Measurement": "UniqueIdentifier MeasurementName TimeRecorded Sequence Result CRDs",
    "NumericMeasurement": "MeasuredValue",
    "NumericValue": "Value ValueUnits ExpectedValue ExpectedValueUnits MinimumAcceptableValue "
    "MinimumAcceptableValueUnits MaximumAcceptableValue MaximumAcceptableValueUnits",
    "Defect": "UniqueIdentifier DefectCode DefectCategory Description Comments ComponentOfInterest RegionOfInterest "
    "DefectImages Priority ConfidenceLevel RelatedMeasurements RelatedSymptoms Verification VerificationDetail",
}
ENUMERATIONS = {
    "TestResult": {"Passed", "Failed", "Error", "Aborted", "Skipped"},
    "InspectionMethod": {"Human", "AOI", "SPI", "AXI"},
    "VerificationResult": {
        *("NotVerifiedYet", "DefectConfirmed", "DefectRejected", "DefectAccepted", "DefectRepaired", "DefectClosed"),
    },
}
SUGGESTED_CATEGORIES = {
    *("ClearenceSurfaceError", "ComponentDefective", "ComponentMissing", "ComponentRotated", "ComponentShifted"),
    *("ComponentTilted", "ConformalCoatingError", "Contamination", "ExcessiveSolder", "FaceDownComponent"),
    *("InsufficientSolder", "LiftedLead", "Miscellaneous", "PasteShort", "PinMissing", "PinShifted"),
    *("ReferencePlaneError", "ShiftedPaste", "Short", "Solderball", "SolderDefect", "SolderPasteDefect", "Tombstone"),
    *("WrongCode", "WrongComponent", "WrongComponentHeight", "WrongPasteArea", "WrongPasteHeight", "WrongPasteVolume"),
    *("WrongPinHeight", "WrongPolarity"),
}
