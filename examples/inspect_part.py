import bgars

part = bgars.read_capture("part")  # made by: bgars simulate defects-5x5 -o part
result = bgars.inspect(part, bgars.sample_part_recipe())
print(result.verdict, result.reasons)
