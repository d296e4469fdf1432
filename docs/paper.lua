-- The front matter of the Journal of Open Source Software in pandoc's terms: its authors with their affiliations; and numbered figures.

local text = pandoc.utils.stringify
local figures = 0

function Meta(meta)
  local places = {}
  for _, place in ipairs(meta.affiliations) do
    places[text(place.index)] = text(place.name)
  end
  meta.author = pandoc.List(meta.authors):map(function(author)
    local named = text(author.affiliation):gsub("%d+", places):gsub("%s*,%s*", "; ")
    return text(author.name) .. " (" .. named .. ")"
  end)
  return meta
end

function Figure(figure)
  figures = figures + 1
  table.insert(figure.caption.long[1].content, 1, pandoc.Strong("Figure " .. figures .. ". "))
  return figure
end
