/** What reaches a mission as a file. */

export const IMPORTS = {
  "imports.imports": { en: "Imports", pt: "Importações" },
  "imports.formats": {
    en: "A file counts once, however often it is sent. What was refused is left out as a whole; logs are used up to where they end.",
    pt: "Um ficheiro conta uma só vez, por mais que se envie. O que foi recusado fica todo de fora; os registos são usados até onde acabam.",
  },
  "imports.dismiss": { en: "Dismiss", pt: "Fechar" },
  "imports.sending": { en: "{name}: sent so far", pt: "{name}: enviado até agora" },
  "imports.sent": { en: "{name}: {sent} of {size} sent", pt: "{name}: {sent} de {size} enviados" },
  "imports.beingRead": { en: "{name}: being taken in…", pt: "{name}: a ser recebido…" },
  "imports.queued": { en: "To be sent next: {names}", pt: "A enviar a seguir: {names}" },
  "imports.nameTheVehicle": {
    en: "{name} does not tell its vehicle: name it first.",
    pt: "{name} não diz de que veículo é: indique-o primeiro.",
  },
  "imports.logs": { en: "Logs of vehicles", pt: "Registos de bordo" },
  "imports.whatLogsAre": {
    en: "What vehicles recorded on board: DUNE's Data.lsf.gz, or a multibeam's .gsf or .kmall. Soundings that came by radio are not counted again.",
    pt: "O que os veículos registaram a bordo: Data.lsf.gz do DUNE, ou .gsf ou .kmall de um multifeixe. As sondas que vieram por rádio não contam outra vez.",
  },
  "imports.asTheLogSays": { en: "as the log says", pt: "como diz o registo" },
  "imports.sendLogs": { en: "Import logs…", pt: "Importar registos…" },
  "imports.noLog": { en: "No log was imported yet.", pt: "Ainda não foi importado nenhum registo." },
  "imports.waits": {
    en: "Waits until another one has been read",
    pt: "Espera até que outro tenha sido lido",
  },
  "imports.read": { en: "Being read: {read}", pt: "A ser lido: {read}" },
  "imports.soundings": {
    en: "Soundings: {accepted} accepted, {rejected} rejected, {known} known already",
    pt: "Sondas: {accepted} aceites, {rejected} recusadas, {known} já conhecidas",
  },
  "imports.pings": {
    en: "Pings: {accepted} accepted, {rejected} rejected, {known} known already",
    pt: "Pings: {accepted} aceites, {rejected} recusados, {known} já conhecidos",
  },
  "imports.nothingNew": {
    en: "The whole file was imported before.",
    pt: "O ficheiro todo já tinha sido importado.",
  },
  "imports.unreadable": {
    en: "{count} {count|packet|packets} unreadable",
    pt: "{count} {count|pacote ilegível|pacotes ilegíveis}",
  },
  "imports.cutOff": {
    en: "The file ends in the middle; what came before is used.",
    pt: "O ficheiro acaba a meio; o que vinha antes é usado.",
  },
  "imports.priors": { en: "Depths to begin with", pt: "Profundidades de partida" },
  "imports.whatPriorsAre": {
    en: "Soundings or a map from elsewhere, weighed by their uncertainty and kept apart from the mission's own.",
    pt: "Sondas ou um mapa de outra origem, pesados pela sua incerteza e separados dos da missão.",
  },
  "imports.whatTheFileDoesNotSay": {
    en: "What the file does not say by itself",
    pt: "O que o ficheiro não diz por si",
  },
  "imports.crs": { en: "Positions in", pt: "Posições em" },
  "imports.crsExample": { en: "such as EPSG:4326", pt: "como EPSG:4326" },
  "imports.values": { en: "Values are", pt: "Os valores são" },
  "imports.asTheFileSays": { en: "as the file says", pt: "o que o ficheiro diz" },
  "imports.depths": { en: "depths (down)", pt: "profundidades (para baixo)" },
  "imports.heights": { en: "heights (up)", pt: "alturas (para cima)" },
  "imports.order": { en: "or surveyed to order", pt: "ou levantado segundo a ordem" },
  "imports.datumOffset": { en: "Added to depths, m", pt: "Somar às profundidades, m" },
  "imports.source": { en: "From where", pt: "De onde" },
  "imports.sendFile": { en: "Import a file…", pt: "Importar um ficheiro…" },
  "imports.noPrior": { en: "The mission begins with nothing.", pt: "A missão parte do nada." },
  "imports.taken": {
    en: "{taken} of {found} depths taken, {shoalest} to {deepest}, ± {sd}",
    pt: "{taken} de {found} profundidades usadas, {shoalest} a {deepest}, ± {sd}",
  },
  "imports.takeBack": { en: "Take back", pt: "Retirar" },
  "imports.takeBackReally": {
    en: "Leave its depths out of the map",
    pt: "Tirar as suas profundidades do mapa",
  },
  "imports.takeLogBackReally": {
    en: "Leave all that it brought out of the map",
    pt: "Tirar do mapa tudo o que trouxe",
  },
  "imports.takenBack": {
    en: "Taken back by {who}, {when}: nothing of it counts. Sent again, it counts again.",
    pt: "Retirado por {who}, {when}: nada dele conta. Enviado de novo, volta a contar.",
  },
  "imports.stop": { en: "Stop", pt: "Parar" },
  "imports.stopReally": {
    en: "Stop, and leave what was read out of the map",
    pt: "Parar, e tirar do mapa o que foi lido",
  },
  "imports.readOn": { en: "Read on", pt: "Continuar a ler" },
  "imports.keep": { en: "Keep it", pt: "Manter" },
  "imports.reference": { en: "Reference grid", pt: "Malha de referência" },
  "imports.whatReferencesAre": {
    en: "A grid that the map is compared with; never used for the map or for planning.",
    pt: "Uma malha com que o mapa é comparado; nunca usada para o mapa nem para planear.",
  },
  "imports.sendGrid": { en: "Compare with a grid…", pt: "Comparar com uma malha…" },
  "imports.removeReference": { en: "Remove", pt: "Remover" },
  "imports.removeReally": { en: "Compare with nothing", pt: "Não comparar com nada" },
  "imports.referenceCells": {
    en: "It knows {cells} {count|cell|cells} of the map.",
    pt: "Conhece {cells} {count|célula|células} do mapa.",
  },
  "imports.seeTheLayer": {
    en: "The map shows it as the layer Difference.",
    pt: "O mapa mostra-a na camada Diferença.",
  },
  "imports.noReference": { en: "The map is compared with nothing.", pt: "O mapa não é comparado com nada." },
} as const;
